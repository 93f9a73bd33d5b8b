"""Units that headers say: each joint's own, in brackets or at the end of its name; no joint is lost for them."""

import numpy as np
import pytest
from foreign_logs import assert_same, motion

from armloop.cli import main
from armloop.convert import Answers, convert
from armloop.convert.headers import suggest
from armloop.convert.units import canonical
from armloop.data.log import MotionLog, read_log
from armloop.util.errors import InputError

DEGREE = np.pi / 180


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return motion()


def write(path, names, log, *, per_unit):
    """A table of a lift in other units than the joints that turn behind it."""
    cells = np.column_stack([log.time, log.q / per_unit, log.v / per_unit, log.tau])
    path.write_text("\n".join([",".join(names), *(",".join(f"{x:.12g}" for x in row) for row in cells)]))
    return path


@pytest.mark.parametrize(
    ("names", "per_unit"),
    [
        (["q1 [mm]", "q2 [deg]", "q3 [rad]", "v1 [mm/s]", "v2 [deg/s]", "v3 [rad/s]"], [1e-3, DEGREE, 1]),
        (["q1_m", "q2_deg", "q3_deg", "v1_m_s", "v2_deg_s", "v3_deg_s"], [1, DEGREE, DEGREE]),
        (["q_mm_1", "q_deg_2", "q_rad_3", "v_mm_s_1", "v_deg_s_2", "v_rad_s_3"], [1e-3, DEGREE, 1]),
        (["a.pos(mm)", "b.pos(deg)", "c.pos(rad)", "a.vel(mm/s)", "b.vel(deg/s)", "c.vel(rad/s)"], [1e-3, DEGREE, 1]),
        (["a_pos_mm", "b_pos_deg", "c_pos_deg", "a_vel_mm_s", "b_vel_deg_s", "c_vel_deg_s"], [1e-3, DEGREE, DEGREE]),
    ],
)  # fmt: skip
def test_each_joints_own_unit_is_read(tmp_path, log, names, per_unit):
    numbered = names[0].startswith("q")
    torques = ["tau1 [N]", "tau2 [Nm]", "tau3 [Nm]"] if numbered else ["a.trq", "b.trq", "c.trq"]
    torques = torques if "." in names[0] or numbered else [name.replace(".", "_") for name in torques]
    path = write(tmp_path / "log.csv", ["time_s", *names, *torques], log, per_unit=np.array(per_unit))
    assert_same(convert([path], answers=Answers(tau_unit="N*m")).log, log)


def test_a_map_of_units_that_differ_reads_the_table(tmp_path, log, capsys):
    names = [
        "time [s]",
        "q1 [mm]",
        "q2",
        "q3 [rad]",
        "v1 [mm/s]",
        "v2",
        "v3 [rad/s]",
        "tau1 [N]",
        "tau2",
        "tau3",
    ]
    path = write(tmp_path / "log.csv", names, log, per_unit=np.array([1e-3, DEGREE, 1]))
    assert main(["convert", str(path), "--suggest", "--map", str(tmp_path / "map.yaml")]) == 0
    text = (tmp_path / "map.yaml").read_text()
    reach = np.degrees(log.q[:, 1])
    assert (
        f"unit: ['mm', '?', 'rad']  # unsure: from {reach.min():.4g} to {reach.max():.4g}: rad or deg?"
        in text
    )
    for said in ("['mm', '?', 'rad']", "[mm/s, '?', rad/s]", "['N', '?', '?']"):
        assert said in text
        text = text.replace(
            said, said.replace("'?'", "N*m" if "'N'" in said else "deg" + "/s" * ("/s" in said))
        )
    (tmp_path / "map.yaml").write_text(text)
    out = tmp_path / "out.parquet"
    assert main(["convert", str(path), "--map", str(tmp_path / "map.yaml"), "--out", str(out)]) == 0
    assert_same(read_log(out), log)
    capsys.readouterr()
    # the command line answers for the joints that say nothing, and for them alone
    answers = ["--angle-unit", "deg", "--tau-unit", "N*m"]
    assert main(["convert", str(path), *answers, "--out", str(tmp_path / "again.parquet")]) == 0
    assert_same(read_log(tmp_path / "again.parquet"), log)


@pytest.mark.parametrize(
    "names",
    [
        ["t", "q1 [rad]", "q2 [rad]", "q1 [deg]", "q2 [deg]", "tau1", "tau2"],  # each joint twice
        ["t", "q1", "q2", "q1_m", "q2_m", "tau1", "tau2"],  # wanted and measured, not metres
    ],
)
def test_one_quantity_in_two_columns_is_no_arm_of_more_joints(names):
    found = suggest(names)
    assert found.mapping is not None
    assert len(found.mapping.q.names()) == 2
    assert found.mapping.q.unit in (None, "rad", "deg")
    assert "q" in found.unsure


@pytest.mark.parametrize("stem", ["torque_cmd_{}", "tau_ext{}", "tau_d{}", "torque_limit{}"])
def test_what_was_asked_for_is_not_taken_for_what_was_measured(tmp_path, log, capsys, stem):
    names = [each.format(j) for each in ("q{} [rad]", "v{} [rad/s]", stem) for j in (1, 2, 3)]
    path = write(tmp_path / "log.csv", ["time [s]", *names], log, per_unit=np.ones(3))
    with pytest.raises(InputError, match="is not what was measured by its name"):
        convert([path], answers=Answers(tau_unit="N*m"))
    assert main(["convert", str(path), "--suggest", "--map", str(tmp_path / "map.yaml")]) == 0
    assert "tau:  # unsure: " in (tmp_path / "map.yaml").read_text()
    assert "is not what was measured by its name" in capsys.readouterr().out


def test_a_motors_current_is_measured(tmp_path, log):
    names = [each.format(j) for each in ("q{} [rad]", "v{} [rad/s]", "motor_current{}") for j in (1, 2, 3)]
    path = write(tmp_path / "log.csv", ["time [s]", *names], log, per_unit=np.ones(3))
    assert_same(convert([path], answers=Answers(tau_unit="A")).log, log)


@pytest.mark.parametrize(
    ("said", "factor"),
    [
        ("N*mm", 1e-3),
        ("Nmm", 1e-3),
        ("N·mm", 1e-3),
        ("mNm", 1e-3),
        ("Ncm", 1e-2),
        ("cN*m", 1e-2),
        ("kNm", 1e3),
    ],
)
def test_torques_in_parts_of_a_newton_metre_are_read(tmp_path, log, said, factor):
    names = [
        "time [s]",
        *(f"{x}{j} [{unit}]" for x, unit in (("q", "rad"), ("v", "rad/s")) for j in (1, 2, 3)),
    ]
    names += [f"tau{j} [{said}]" for j in (1, 2, 3)]
    path = tmp_path / "log.csv"
    cells = np.column_stack([log.time, log.q, log.v, log.tau / factor])
    path.write_text("\n".join([",".join(names), *(",".join(f"{x:.12g}" for x in row) for row in cells)]))
    found = convert([path]).log
    np.testing.assert_allclose(found.tau, log.tau, rtol=1e-9)


@pytest.mark.parametrize(
    ("names", "per_unit"),
    [
        (["Istposition{} [Grad]", "Geschwindigkeit{} [Grad/s]"], DEGREE),
        (["Winkel{} (°)", "Drehzahl{} (U/min)"], [DEGREE, np.pi / 30]),
        (["Posizione{} [gradi]", "Velocità{} [gradi/sec]"], DEGREE),
        (["Положение{} [град]", "Скорость{} [рад/s]"], [DEGREE, 1.0]),
    ],
)
def test_units_are_read_as_other_languages_spell_them(tmp_path, log, names, per_unit):
    each = [stem.format(j) for stem in (*names, "Moment{} [Nmm]") for j in (1, 2, 3)]
    of_q, of_v = np.broadcast_to(per_unit, 2)
    cells = np.column_stack([1e3 * log.time, log.q / of_q, log.v / of_v, 1e3 * log.tau])
    path = tmp_path / "log.csv"
    path.write_text(
        "\n".join([",".join(["Zeit [ms]", *each]), *(",".join(f"{x:.12g}" for x in row) for row in cells)])
    )
    found = suggest(["Zeit [ms]", *each])
    assert found.mapping is not None and not [field for field in found.unsure if field.endswith("unit")]
    assert_same(convert([path]).log, log)


@pytest.mark.parametrize(
    ("quantity", "written", "unit"),
    [
        ("vdot", "Grad/s²", "deg/s^2"),
        ("vdot", "mm/s²", "mm/s^2"),
        ("vdot", "°/s^2", "deg/s^2"),
        ("vdot", "rad/s**2", "rad/s^2"),
        ("vdot", "m/s2", "m/s^2"),
        ("vdot", "rad/s", None),
        ("vdot", "rev/s^2", None),  # no factor is known of it
        ("v", "U/s", "rev/s"),
        ("v", "rad/s^2", None),
        ("time", "Sek", "s"),
        ("tau", "Prozent", "%"),
        ("q", "/s", None),
    ],
)
def test_a_unit_by_its_spelling(quantity, written, unit):
    assert canonical(written, quantity) == unit
