"""Every export, read back by its consumer, gives the model's torques as far as the target can say them."""

import json
import re
import subprocess
import sys
import warnings
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from answers import answered
from chains import RAIL, arm_of
from exact_parts import ARMS, disguised, energies, model_of, rigid_body, scara_terms

from armloop.cli import main
from armloop.data.motion import Motion
from armloop.export import export
from armloop.export.c_code import c_source
from armloop.export.expressible import random_motion
from armloop.export.reading_c import CompiledTorque, compiler
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel
from armloop.robot.arm import load_arm
from armloop.util.errors import InputError, ModelError

PLAIN = (FrictionTerm("sign", 0.7), FrictionTerm("viscous", 2.0))
RICH = (
    FrictionTerm("offset", 0.2),
    FrictionTerm("sign", 0.3),
    FrictionTerm("smooth_sign", 0.2, 0.05),
    FrictionTerm("hysteresis", 0.4, 1e-3),
    FrictionTerm("hysteresis", 0.2, 1e-2),
    FrictionTerm("load_sign", 0.03),
    FrictionTerm("load_hysteresis", 0.02, 3e-3),
    FrictionTerm("viscous_forward", 1.0),
    FrictionTerm("viscous_backward", 1.2),
    FrictionTerm("root", 0.1),
    FrictionTerm("quadratic", 0.05),
    FrictionTerm("cubic", 0.02),
    FrictionTerm("stribeck_peak", 0.3, 0.1),
    FrictionTerm("stribeck", -0.1, 0.2),
)
EFFECTS: tuple = (
    ("payload", None, {"mass": 0.8, "com": [0.05, 0.01, -0.02], "own_inertia": 1e-3}),
    ("rotor_inertia", 2, {"inertia": 0.11}),
    ("joint_spring", 1, {"stiffness": 3.0, "rest": 0.2}),
    ("viscous_friction", 2, {"coefficient": 0.4}),
    ("coulomb_friction", 1, {"level": 0.15}),
)
SUBTLE: tuple = (
    ("torque_ripple", 1, {"amplitude": 0.3, "order": 17.0, "phase": 0.4}),
    ("stribeck_friction", 2, {"static_excess": 0.3, "velocity": 0.2}),
    ("friction_asymmetry", 1, {"level": 0.1}),
    ("load_dependent_friction", 2, {"coefficient": 0.05}),
    ("quadratic_drag", 1, {"coefficient": 0.2}),
    ("friction_drift", 2, {"level": 0.4, "time_constant": 30.0}),
    ("presliding_hysteresis", 1, {"level": 0.5, "width": 0.01, "level_change": -0.2}),
    ("gravity_tilt", None, {"roll": 0.03, "pitch": -0.02}),
)


def coupled(model: ReconstructedModel) -> ReconstructedModel:
    values = {"inertia": 0.05, "viscous": 0.3, "coulomb": 0.2, "ratio": -1.0}
    return model.with_effects(
        [
            AddedEffect(
                effect("transmission_coupling", 1, 2), {k: Estimate(x, 0.0, "") for k, x in values.items()}
            )
        ]
    )


@pytest.mark.parametrize("rotors", [False, True])
@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("target", ["urdf", "sdf", "mjcf", "drake"])
def test_what_a_target_can_say_reads_back(tmp_path, target, name, rotors):
    if target == "mjcf":
        pytest.importorskip("mujoco")
    model = model_of(ARMS[name], disguised(ARMS[name], rotors), friction=PLAIN, effects=EFFECTS)
    found = export(model, target, tmp_path / "arm")
    assert found.difference is not None and found.consumer
    assert (found.difference < 1e-6 * found.rms).all()
    assert not any("no bodies" in line for line in found.missing)
    if target == "mjcf":  # says all of it
        assert found.missing == [] and (found.unsaid < 1e-6 * found.rms).all()


@pytest.mark.parametrize("rotors", [False, True])
@pytest.mark.parametrize("name", ARMS)
def test_a_tilt_reads_back_with_the_first_moment_that_a_level_arm_hides(tmp_path, name, rotors):
    pytest.importorskip("mujoco")
    for moment in ([0.0, 0.0, 0.0], [0.05, -0.03, 0.0]):
        tilt = ("gravity_tilt", None, {"roll": 0.03, "pitch": -0.02, "first_moment": moment})
        model = model_of(ARMS[name], disguised(ARMS[name], rotors), friction=PLAIN, effects=(tilt,))
        found = export(model, "mjcf", tmp_path / "arm")
        assert found.unsaid is not None and (found.unsaid < 1e-6 * found.rms).all()


def test_states_are_as_often_slow_in_each_octave_as_fast():
    model = model_of(ARMS["three_axis"])
    speeds = np.abs(random_motion(model, 4000, seed=1).v) / model.ranges[1]
    assert speeds.min() > 0.02 and speeds.max() < 1.0
    octaves = np.histogram(np.log2(speeds), bins=[-5, -4, -3, -2, -1, 0])[0]
    np.testing.assert_allclose(octaves, octaves.mean(), rtol=0.1)


def test_a_tilt_of_an_arm_on_a_rail_reads_back_with_what_of_it_has_no_weight(tmp_path):
    pytest.importorskip("mujoco")
    tilt = ("gravity_tilt", None, {"roll": 0.03, "pitch": -0.02, "weightless": [1.5, 0.0, 0.0]})
    model = model_of(arm_of(tmp_path, *RAIL), friction=PLAIN, effects=(tilt,))
    found = export(model, "mjcf", tmp_path / "arm")
    assert found.unsaid is not None and (found.unsaid < 1e-6 * found.rms).all()


@pytest.mark.parametrize("down", [(-0.05, 0.03, -1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("target", ["urdf", "sdf", "mjcf", "drake"])
def test_an_arm_that_leans_does_so_in_every_description(tmp_path, target, name, down):
    """Its first joint is turned on a level base: a reader's own gravity acts on it as the model's does."""
    if target == "mjcf":
        pytest.importorskip("mujoco")
    arm = replace(ARMS[name], gravity=9.81 * np.array(down) / np.linalg.norm(down))
    found = export(model_of(arm, disguised(arm, False), friction=PLAIN), target, tmp_path / "arm")
    assert found.difference is not None and (found.difference < 1e-6 * found.rms).all()
    assert not any("tilt" in line for line in found.missing)
    assert any("the base leans" in note for note in found.notes)
    if target == "mjcf":
        assert found.unsaid is not None and (found.unsaid < 1e-6 * found.rms).all()


@pytest.mark.parametrize(("target", "name", "other"), [("urdf", "arm.SDF", "sdf"), ("c", "arm.urdf", "urdf")])
def test_a_name_by_which_readers_take_it_for_another_format_is_refused(tmp_path, target, name, other):
    with pytest.raises(
        InputError, match=f"by which readers take it for {other}; give another name, or --to {other}"
    ):
        export(model_of(load_arm("three_axis")), target, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("target", ["urdf", "sdf", "drake"])
def test_what_becomes_of_the_links_names_is_said(tmp_path, target):
    arm = replace(ARMS["three_axis"], X_tool=np.eye(4))
    found = export(model_of(arm, disguised(arm, False), friction=PLAIN), target, tmp_path / "arm")
    links = re.findall(r'<link name="(\w+)"', found.files[0].read_text())
    assert [name for name in links if name not in ("world", "base_link")] == ["link_1", "link_2", "link_3"]
    assert any("links are named link_1, link_2, .." in note for note in found.notes)


@pytest.mark.parametrize("target", ["urdf", "sdf", "mjcf"])
def test_a_tool_is_where_the_urdf_has_one_and_nowhere_else(tmp_path, target):
    arm = ARMS["three_axis"]
    for X_tool in (np.eye(4), arm.X_tool):
        found = export(
            model_of(replace(arm, X_tool=X_tool), disguised(arm, False), friction=PLAIN),
            target,
            tmp_path / "arm",
        )
        assert ('name="tool"' in found.files[0].read_text()) == (X_tool is arm.X_tool)


@pytest.mark.parametrize("target", ["urdf", "sdf", "mjcf", "drake"])
def test_energies_and_terms_become_the_bodies_they_are(tmp_path, target):
    if target == "mjcf":
        pytest.importorskip("mujoco")
    for model in (
        model_of(ARMS["three_axis"], energies(ARMS["three_axis"]), friction=PLAIN),
        model_of(ARMS["scara"], *scara_terms(ARMS["scara"]), friction=PLAIN),
    ):
        found = export(model, target, tmp_path / "arm", None)
        assert (found.difference < 1e-6 * found.rms).all()
        if target == "mjcf":
            assert (found.unsaid < 1e-6 * found.rms).all()


def test_what_cannot_be_said_is_listed_and_the_nearest_friction_is_written(tmp_path):
    model = model_of(ARMS["three_axis"], friction=RICH, effects=(*EFFECTS, *SUBTLE))
    found = export(model, "urdf", tmp_path / "arm.urdf")
    text = "\n".join(found.missing)
    for word in (
        "Stribeck",
        "memory",
        "load",
        "a constant torque",
        "spring",
        "tilt",
        "torque_ripple",
        "dry friction",
    ):
        assert word in text
    assert (found.difference < 1e-6 * found.rms).all()
    bare = model_of(ARMS["three_axis"], friction=(), effects=EFFECTS)
    plain = export(bare, "urdf", tmp_path / "bare.urdf")
    assert "Stribeck" not in "\n".join(plain.missing)


def test_of_added_friction_that_grows_with_the_load_the_drake_program_says_which_load_it_takes(tmp_path):
    by_load = ("load_dependent_friction", 2, {"coefficient": 0.3})
    found = export(
        model_of(ARMS["three_axis"], friction=PLAIN, effects=(by_load,)), "drake", tmp_path / "arm"
    )
    assert found.unsaid[1] > 1e-3 * found.rms[1]
    assert found.missing == ["friction that grows with the load takes the load without acceleration"]


def test_of_friction_that_fades_the_drake_program_has_a_clock(tmp_path):
    """What it leaves of the whole model, which is a warm joint's, is said where it is, and only there."""
    drift = ("friction_drift", 2, {"level": 0.4, "time_constant": 30.0})
    for effects, left in (((drift,), 0.4), ((), 0.0)):
        found = export(
            model_of(ARMS["three_axis"], friction=PLAIN, effects=effects), "drake", tmp_path / f"{left}"
        )
        # at the slowest states the program's dry friction has not quite set in
        assert found.unsaid[1] == pytest.approx(left, abs=0.02)
        told = [
            line
            for line in found.missing
            if line.startswith("friction_drift at joint 2: the program's clock")
        ]
        assert len(told) == len(effects)


@pytest.mark.slow
def test_what_the_drake_program_leaves_out_of_a_record_and_of_one_run_is_said_once(tmp_path):
    drift = ("torque_drift", 1, {"rate": 0.01, "time_constant": 60.0, "offset": 0.1})
    push = ("external_torque", 2, {"start": 1.0, "end": 2.0, "torque": 3.0})
    found = export(
        model_of(ARMS["three_axis"], friction=PLAIN, effects=(drift, push)), "drake", tmp_path / "arm"
    )
    assert found.missing == [
        "torque_drift at joint 1: a fault of the record",
        "external_torque at joint 2: an event of one run",
    ]


def test_the_drake_program_has_all_of_the_model(tmp_path):
    model = model_of(ARMS["three_axis"], friction=RICH, effects=(*EFFECTS, *SUBTLE))
    found = export(model, "drake", tmp_path / "arm")
    assert (found.difference < 1e-6 * found.rms).all()
    # Where joints slide, all that is left is how dry friction sets in, and the load's acceleration.
    assert (found.unsaid < 0.5 * found.rms).all()
    program = (tmp_path / "arm" / "simulate.py").read_text()
    lines = [line for line in program.splitlines() if line and not line.startswith(("from", "import", '"""'))]
    assert len(lines) == 9
    done = subprocess.run(
        [sys.executable, str(tmp_path / "arm" / "simulate.py")],
        capture_output=True,
        text=True,
        check=True,
        cwd="/",
    )
    assert "q after 0.1 s" in done.stdout


def test_a_root_of_the_speed_does_not_take_dry_friction_away(tmp_path):
    """Infinitely steep at rest, whatever dry friction does: it is rounded off, not dry friction with it."""
    widths = []
    for root in (0.0, 0.5):
        terms = FrictionTerm("sign", 0.5), FrictionTerm("viscous", 2.0), FrictionTerm("root", root)
        found = export(model_of(ARMS["three_axis"], friction=terms), "drake", tmp_path / f"{root}")
        assert (found.difference < 1e-6 * found.rms).all()
        program = (tmp_path / f"{root}" / "simulate.py").read_text()
        widths.append(json.loads(re.search(r"smoothing=(\[[^]]*\])", program)[1]))
    assert np.all(np.divide(*widths[::-1]) < 1.5)


@pytest.mark.slow
@pytest.mark.parametrize("steep", [False, True])
def test_the_drake_program_does_not_chatter_and_a_steeper_one_would(tmp_path, steep):
    """Dry friction of the model that fades in over a thousandth of rad/s, on links as light as a wrist's."""
    friction = (FrictionTerm("smooth_sign", 2.0, 1e-3), FrictionTerm("viscous", 0.5))
    model = model_of(ARMS["three_axis"], friction=friction)
    found = export(model, "drake", tmp_path / "arm")
    assert (found.difference < 1e-6 * found.rms).all()
    assert "w is" in " ".join(found.notes) and "a joint creeps" in " ".join(found.notes)
    program = (tmp_path / "arm" / "simulate.py").read_text()
    widths = re.search(r"smoothing=(\[[^]]*\])", program)
    assert widths is not None and max(json.loads(widths[1])) < 1.0
    program = program.replace("Path(__file__).parent", repr(tmp_path / "arm").replace("PosixPath", "Path"))
    program = program.replace(widths[1], "0.001") if steep else program
    program = program.replace(
        "simulator = ",
        "from pydrake.all import LogVectorOutput\n"
        "log = LogVectorOutput(plant.get_state_output_port(), builder, 0.001)\nsimulator = ",
    )
    scope: dict = {}
    exec(program.replace("AdvanceTo(0.1)", "AdvanceTo(0.5)"), scope)
    states = scope["log"].FindLog(scope["simulator"].get_context()).data()
    turns = np.sign(np.diff(states[3:], axis=1))
    alternating = (turns[:, 1:] * turns[:, :-1] < 0).mean(axis=1)
    assert (alternating.max() > 0.5) == steep


needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler (cc, gcc, clang)")
MODELS = {
    "body": lambda: model_of(
        ARMS["six"], disguised(ARMS["six"], True), friction=RICH, effects=(*EFFECTS, *SUBTLE)
    ),
    "energies": lambda: model_of(
        ARMS["three_axis"], energies(ARMS["three_axis"]), friction=RICH, effects=EFFECTS
    ),
    "terms": lambda: model_of(ARMS["scara"], *scara_terms(ARMS["scara"]), friction=RICH),
    "coupled": lambda: coupled(model_of(ARMS["three_axis"], friction=PLAIN)),
    "frictionless": lambda: model_of(ARMS["scara"], friction=()),
}


@needs_compiler
@pytest.mark.parametrize("kind", MODELS)
def test_the_c_file_is_the_feedforward_to_rounding(tmp_path, kind):
    model = MODELS[kind]()
    source, _ = c_source(model)
    assert "malloc" not in source and source.count("#include") == 1
    (tmp_path / "arm.c").write_text(source)
    compiled = CompiledTorque(tmp_path / "arm.c")  # -std=c99 -Wall -Wextra -Werror
    rng = np.random.default_rng(1)
    q, v, vdot = rng.uniform(-3, 3, (3, 300, model.arm.n))
    v[:20] = 0.0  # at rest, too
    v[20:40, 0] = 0.0
    expected = np.array([model.feedforward(*row) for row in zip(q, v, vdot, strict=True)])
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(compiled.torque(q, v, vdot) - expected) <= 1e-13 * scale + 1e-13).all()


@needs_compiler
@pytest.mark.parametrize("kind", ["body", "energies", "terms"])
def test_the_c_file_remembers_as_the_model_predicts(tmp_path, kind):
    model = MODELS[kind]()
    model = replace(model, effects=tuple(a for a in model.effects if a.effect.name != "friction_drift"))
    (tmp_path / "arm.c").write_text(c_source(model)[0])
    time = np.arange(0, 4, 4e-3)
    n = model.arm.n
    w, size = np.linspace(0.8, 2.5, n), 0.3 * (1 - np.exp(-(time[:, None] ** 2)))
    q = size * np.sin(w * time[:, None] ** 1.5)
    v = np.gradient(q, time, axis=0)
    v[0] = 0.0
    vdot = np.gradient(v, time, axis=0)
    expected = model.predict(Motion(time, q, v, vdot, np.array([0])))
    found = CompiledTorque(tmp_path / "arm.c").remembered(q, v, vdot)
    slid = CompiledTorque(tmp_path / "arm.c").torque(q, v, vdot)
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected) <= 1e-11 * scale).all()
    assert np.abs(slid - expected).max() > 1e-3  # memory matters here


def test_the_exported_urdf_is_the_same_arm(tmp_path):
    for arm in (ARMS["three_axis"], ARMS["scara"]):
        export(model_of(arm, friction=PLAIN), "urdf", tmp_path / "arm.urdf")
        again = load_arm(tmp_path / "arm.urdf")
        assert again.fingerprint() == arm.fingerprint()
        assert [j.name for j in again.joints] == [j.name for j in arm.joints]
        np.testing.assert_allclose(again.X_tool, arm.X_tool, atol=1e-12)


def test_a_continuous_joint_without_limits_stays_without(tmp_path):
    arm = ARMS["three_axis"]
    free = replace(arm.joints[0], lower=-np.inf, upper=np.inf, velocity=np.inf, effort=np.inf)
    arm = replace(arm, joints=(free, *arm.joints[1:]))
    export(model_of(arm, disguised(arm, False), friction=PLAIN), "urdf", tmp_path / "arm.urdf")
    assert load_arm(tmp_path / "arm.urdf").joints == arm.joints


@pytest.mark.parametrize(("lower", "upper"), [(0.3, np.inf), (-np.inf, -0.3), (-np.inf, np.inf)])
def test_a_joint_with_one_limit_keeps_it_in_every_description(tmp_path, lower, upper):
    """A format that takes both ends or none must not take 0, or nothing, for the other."""
    arm = ARMS["scara"]
    arm = replace(arm, joints=tuple(replace(joint, lower=lower, upper=upper) for joint in arm.joints))
    for target in ("urdf", "mjcf"):
        export(model_of(arm, friction=PLAIN), target, tmp_path / f"arm.{target}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a limit so far away is none
        assert load_arm(tmp_path / "arm.urdf").joints == arm.joints
    ends = [lower if np.isfinite(lower) else -1e7, upper if np.isfinite(upper) else 1e7]
    limited, kinds = ends != [-1e7, 1e7], [joint.kind for joint in arm.joints]
    for joint, kind in zip(
        ElementTree.parse(tmp_path / "arm.urdf").findall("joint")[1:], kinds, strict=False
    ):
        assert joint.get("type") == (kind if limited or kind == "prismatic" else "continuous")
        told = [joint.find("limit").get(key) for key in ("lower", "upper")]
        assert told == ([*map(str, ends)] if limited or kind == "prismatic" else [None, None])
    for joint in ElementTree.parse(tmp_path / "arm.mjcf").iter("joint"):
        assert joint.get("range") == (f"{ends[0]} {ends[1]}" if limited else None)


def test_the_command_prints_and_answers(tmp_path, capsys):
    model_of(ARMS["three_axis"], friction=RICH).save(tmp_path / "model.json")
    line = ["export", str(tmp_path / "model.json"), "--to", "sdf", "--out", str(tmp_path / "arm.sdf")]
    assert main(line) == 0
    out = capsys.readouterr().out
    assert "read back by Drake" in out and "cannot say" in out and "Stribeck" in out
    assert "N·m" in out and "N*m" not in out and max(map(len, out.splitlines())) <= 110
    assert main([*line, "--json"]) == 0
    answer = answered(capsys.readouterr().out, "export")
    assert max(answer["difference"]) < 1e-6 * max(answer["rms"])
    assert answer["files"] == [str(tmp_path / "arm.sdf")]


def test_currents_are_no_torques(tmp_path, capsys):
    model = replace(model_of(ARMS["three_axis"]), recorded={"unit": "A", "drive_gains": None})
    with pytest.raises(ModelError, match="currents"):
        export(model, "urdf", tmp_path / "arm.urdf")
    assert not (tmp_path / "arm.urdf").exists()
    export(model, "c", tmp_path / "arm.c")
    assert "current in A" in (tmp_path / "arm.c").read_text()


def test_without_a_consumer_the_file_is_written_and_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    found = export(model_of(ARMS["scara"]), "mjcf", tmp_path / "arm.xml")
    assert found.difference is None and any("not installed" in note for note in found.notes)
    assert (tmp_path / "arm.xml").exists()
    assert rigid_body(ARMS["scara"]).parameters.shape == (40,)


def test_a_current_is_in_amperes_at_a_sliding_joint_too():
    model = replace(
        model_of(ARMS["scara"], disguised(ARMS["scara"], False)), recorded={"unit": "A", "drive_gains": None}
    )
    units = re.findall(r"^ \*   \d  \S+: (\w+), (\S+)$", c_source(model)[0], re.MULTILINE)
    assert units == [("rad", "A"), ("rad", "A"), ("m", "A"), ("rad", "A")]
