"""A base that leans is found by the torques, and the model takes gravity as it is."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from leaning_arm import three_axes, turned_by, upright_axes
from synthetic import fourier_motion, friction, rigid_torque, three_axis
from synthetic import measured as recorded

from armloop.api.model import load_model as api_load
from armloop.data.log import MotionLog, read_log
from armloop.data.signals import preprocess
from armloop.identification.reconstruction import Options, Reconstruction, mounting, reconstruct
from armloop.identification.reconstruction.gravity_direction import Direction
from armloop.identification.reconstruction.mounting import Mounting, earned
from armloop.identification.reconstruction.plain_fits import Fit, PlainFits
from armloop.identification.reconstruction.stance_angles import refined
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.identification.reconstruction.zero_offsets import ZeroOffset
from armloop.identification.scoring import score
from armloop.model import load_model
from armloop.robot.arm import Arm, load_arm
from armloop.util.errors import LogError

#: What takes long in sum, of many like it.
LONG = pytest.mark.long


def leaning_of(logs: Sequence[MotionLog], arm: Arm, cutoff_hz: float) -> Mounting | None:
    """How the base leans, and that nothing else is off."""
    found = check_torques(logs, arm, cutoff_hz)
    assert len(found) <= 1 and all(isinstance(one, Mounting) for one in found)
    return found[0] if found else None  # type: ignore[return-value]


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=LONG)])
@pytest.mark.parametrize(
    ("degrees", "axis", "dry"), [(3.0, (1, 0, 0), 0.1), (8.0, (0, 1, 0), 1.0), (15.0, (1, -1, 0), 1.0)]
)
def test_a_lean_is_found_within_its_errors(
    seed: int, degrees: float, axis: tuple[float, float, float], dry: float
) -> None:
    leaning = turned_by(three_axis(), degrees, axis)
    found = leaning_of([three_axes(seed, leaning, dry)], three_axis(), 10.0)
    assert found is not None and found.lean is not None
    assert found.lean.beside(leaning.gravity / np.linalg.norm(leaning.gravity)) < 5 * found.lean.std_error
    assert found.angle == pytest.approx(np.radians(degrees), abs=5 * found.lean.std_error)
    assert found.lean.std_error < np.radians(0.3)
    np.testing.assert_allclose(found.of(three_axis()).gravity, leaning.gravity, atol=0.15)


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=LONG) for k in (2, 3))])
def test_a_level_base_does_not_lean_whatever_else_acts(seed: int) -> None:
    """Springs and waves at the first joint or between joints, a gain, an encoder's zero: they look like it a little."""
    arm = three_axis()
    motion = fourier_motion(40.0, 100.0, seed)
    q, v = motion.q, motion.v
    tau = rigid_torque(arm, q, v, motion.vdot) + 0.3 * friction(v)
    size = np.sqrt(np.mean(tau**2, axis=0))
    first, second = np.eye(3)[0], np.eye(3)[1]
    elsewhere = rigid_torque(arm, q + 0.05 * second, v, motion.vdot) - rigid_torque(arm, q, v, motion.vdot)
    for law in (
        0 * q,
        np.outer(0.2 * q[:, 0], size * first),
        np.outer(0.2 * np.sin(q[:, 0] + 0.7), size * first),
        np.outer(0.05 * np.sin(q[:, 0] - q[:, 1]), size * first),
        np.outer(0.2 * q[:, 0] * q[:, 1], size * first),
        0.15 * tau * first,
        0.15 * tau * second,
        elsewhere,
    ):
        assert check_torques([recorded(motion, tau + law, seed)], arm, 10.0) == []


@pytest.mark.parametrize(
    ("seed", "size"),
    [(1, 0.1), *(pytest.param(*each, marks=LONG) for each in ((1, 0.2), (4, 0.1), (4, 0.2)))],
)
def test_laws_of_one_joint_on_short_strokes_are_no_other_mounting(seed: int, size: float) -> None:
    """There gravity's sine is as good a line as a spring's, and one direction is as good as another."""
    arm, motion = three_axis(), fourier_motion(60.0, 100.0, seed, size=size)
    q, first = motion.q, np.eye(3)[0]
    tau = rigid_torque(arm, q, motion.v, motion.vdot) + 0.3 * friction(motion.v)
    for law in (5 * (q[:, 0] - 0.05), 2 * np.sin(q[:, 0] - q[:, 1]), 5 * q[:, 0] * q[:, 1]):
        assert check_torques([recorded(motion, tau + np.outer(law, first), seed)], arm, 10.0) == []


@pytest.mark.parametrize(
    ("slower", "rubbing", "seed"),
    [
        (1.0, 0.1, 1),
        *(
            pytest.param(*each, marks=LONG)
            for each in ((1.0, 3.0, 1), (1.0, 3.0, 2), (1.0, 0.1, 2), (4.0, 1.0, 1), (4.0, 1.0, 2))
        ),
    ],
)
def test_the_slightest_lean_of_upright_axes_is_seen(seed: int, slower: float, rubbing: float) -> None:
    """A level base spares them gravity: the torques have no slope there, and any other direction explains nearly as much."""
    # friction of three times all else hides two degrees
    for lean in (0.03 if rubbing < 3.0 else 0.05, 0.3) if seed == 1 else (0.1,):
        log = upright_axes(seed, lean, slower, rubbing)
        found = leaning_of([log], load_arm("scara"), 10.0)
        if (
            slower == 1.0
        ):  # slow motion does not tell how far, for the torque is that of a moment times a sine
            assert found is not None and found.angle == pytest.approx(lean, rel=0.15)
    if slower == seed == 1:
        with pytest.raises(LogError, match="the arm seems to be mounted otherwise"):
            check_torques([upright_axes(seed, 1.2, slower, rubbing)], load_arm("scara"), 10.0)


@pytest.mark.parametrize(
    ("seed", "lean", "rubbing"),
    [
        (5, 0.1, 1.0),
        *(pytest.param(*each, marks=LONG) for each in ((1, 0.3, 0.1), (2, 0.3, 1.0), (5, 0.2, 3.0))),
    ],
)
def test_upright_axes_of_a_slow_record_neither_hang_nor_lean_beyond_doubt(
    seed: int, lean: float, rubbing: float
) -> None:
    """Slow, they hang as well as they stand, and a lean of 6 to 17 degrees seemed to be one of 9 to 33."""
    check_torques([upright_axes(seed, lean, 4.0, rubbing)], load_arm("scara"), 10.0)


@pytest.mark.long
@pytest.mark.measured
def test_measured_arms_stand_level_and_lean_where_their_urdf_does(measured: Path) -> None:
    for folder, path, least in (
        ("panda", "exciting_1a", 1.5),  # by a degree it leans no more than springs would explain
        ("ur10e", "noload_20_02_10-20sec_7harm", 10.0),
    ):
        arm = load_arm(measured / folder / f"{folder}.urdf")
        log = read_log(measured / folder / f"{path}.csv", quiet=True)
        assert check_torques([log], arm, 8.0) == []
        for degrees in {least, 10.0}:
            stances = check_torques([log], turned_by(arm, degrees, (0.6, 0.8, 0.0)), 8.0)
            (found,) = (one for one in stances if isinstance(one, Mounting))
            # they are not quite level themselves, nor is the Panda's joint 4 quite at the URDF's zero
            assert np.degrees(found.angle) == pytest.approx(degrees, abs=1.5)
            assert all(one.angle == pytest.approx(-0.03, abs=0.01) for one in stances if one is not found)


@cache
def made_of_leaning(library: str) -> tuple[Arm, Reconstruction, list[tuple[Arm, list[Any]]]]:
    """An arm that leans, what is reconstructed of its logs with the URDF's, and of what it was asked how that stands."""
    leaning = turned_by(three_axis(), 6.0, (0, 1, 0))
    asked: list[tuple[Arm, list[Any]]] = []

    def spied(logs: Any, arm: Arm, cutoff_hz: float, aside: Any) -> Any:
        asked.append((arm, list(aside)))
        return check_torques(logs, arm, cutoff_hz, aside)

    logs = [three_axes(seed, leaning, 0.3) for seed in (1, 2)]
    options = Options(parts=False, standard_errors=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules[reconstruct.__module__], "check_torques", spied)
        return leaning, reconstruct(logs, three_axis(), library=library, options=options), asked


@pytest.mark.parametrize("library", ["rigid-body", pytest.param("lagrangian", marks=LONG)])
def test_a_model_of_an_arm_that_leans_has_gravity_as_it_is(library: str, tmp_path: Path) -> None:
    leaning, found = made_of_leaning(library)[:2]
    (said,) = [note for note in found.notes if "the base leans by" in note]
    assert "gravity acts along (0.1" in said or "gravity acts along (-0.1" in said
    model = found.model
    model.save(tmp_path / "model.json")
    kept = load_model(tmp_path / "model.json", three_axis())
    np.testing.assert_allclose(kept.arm.gravity, leaning.gravity, atol=0.1)
    assert kept.history["leaning"]["angle"] == pytest.approx(np.radians(6.0), abs=0.01)
    assert said in str(api_load(tmp_path / "model.json"))
    other = preprocess([three_axes(3, leaning, 0.3)], kept.conditioning)
    # so small a motion tells few of the energies' terms
    assert max(score(kept, other).moving["nrmse"]) < {"rigid-body": 0.02, "lagrangian": 0.05}[library]


def test_what_is_held_out_says_nothing_of_how_the_arm_stands() -> None:
    leaning = turned_by(three_axis(), 6.0, (0, 1, 0))
    log, aside = three_axes(1, leaning, 0.3), [np.array([[8.0, 20.0], [30.0, 33.0]])]
    hidden = (log.time > 8.3) & (log.time < 19.7) | (log.time > 30.3) & (log.time < 32.7)
    spoilt = replace(log, tau=np.where(hidden[:, None], 0.2 * log.tau, log.tau))
    (seen,), (same,) = (check_torques([one], three_axis(), 10.0, aside) for one in (log, spoilt))
    np.testing.assert_allclose(same.of(three_axis()).gravity, seen.of(three_axis()).gravity, atol=1e-3)
    # with them it would be another
    other = check_torques([spoilt], three_axis(), 10.0)
    assert not other or not np.allclose(other[0].of(three_axis()).gravity, leaning.gravity, atol=0.1)
    # and where nothing else is left, nothing is said
    assert check_torques([log], three_axis(), 10.0, [np.array([[0.0, 39.0]])]) == []


def test_what_is_not_found_again_leaves_the_urdfs_arm_and_its_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    module = sys.modules[reconstruct.__module__]
    answers: list[list[Any]] = [[ZeroOffset(1, 0.1, 0.001)], []]
    arms: list[Arm] = []
    usual = module.prepared  # type: ignore[attr-defined]

    def spied(logs: Any, kept: Any, **how: Any) -> Any:
        arms.append(how["arm"])
        return usual(logs, kept, **how)

    monkeypatch.setattr(module, "check_torques", lambda *given: answers.pop(0))
    monkeypatch.setattr(module, "prepared", spied)
    options, said = Options(parts=False, standard_errors=False), []
    found = reconstruct(
        [three_axes(seed, three_axis(), 0.3) for seed in (1, 2)],
        three_axis(),
        library="rigid-body",
        options=options,
        progress=said.append,
    )
    assert not answers and "zeros" not in found.model.history
    assert [list(arm.zeros) for arm in arms] == [[], [0.0, 0.1, 0.0], []]
    assert any("whether the torques are this arm's" in one for one in said)


def test_a_model_is_reconstructed_on_what_stands_aside() -> None:
    """How the arm stands is found twice, from the URDF's arm, each time without the blocks that are held out then."""
    asked = made_of_leaning("rigid-body")[2]
    assert len(asked) == 2
    for arm, aside in asked:
        assert arm is three_axis() and len(aside) == 2 and all(len(intervals) for intervals in aside)


def fit_of(*relative: float, faults: int = 0) -> Fit:
    return Fit(
        np.array(relative),
        np.ones(len(relative)),
        np.where(np.arange(len(relative)) < faults, -1.0, 1.0),
    )


@pytest.mark.parametrize(
    ("other", "sprung", "taken"),
    [
        # all a tenth better in the geometric mean, a second joint by a fifth, and none worse than by a quarter
        (fit_of(0.2, 0.2, 0.3), fit_of(0.3, 0.3, 0.3), True),
        (fit_of(0.245, 0.245, 0.369), fit_of(0.3, 0.3, 0.3), False),
        (fit_of(0.2, 0.249, 0.3), fit_of(0.3, 0.3, 0.3), True),
        (fit_of(0.1, 0.251, 0.3), fit_of(0.3, 0.3, 0.3), False),
        (fit_of(0.1, 0.1, 0.374), fit_of(0.3, 0.3, 0.3), True),
        (fit_of(0.1, 0.1, 0.376), fit_of(0.3, 0.3, 0.3), False),
        # more than springs do, by a fifth in logarithms: 2.25 times against 2.25 ** (1 / 1.2) = 1.966
        (fit_of(0.2, 0.2, 0.1 * 8 / 9), fit_of(0.2, 0.2, 0.134), True),
        (fit_of(0.2, 0.2, 0.1 * 8 / 9), fit_of(0.2, 0.2, 0.08), False),
        # and not less physically
        (fit_of(0.2, 0.2, 0.3, faults=1), fit_of(0.3, 0.3, 0.3), True),
        (fit_of(0.2, 0.2, 0.3, faults=2), fit_of(0.3, 0.3, 0.3), False),
    ],
)  # fmt: skip
def test_another_stance_must_explain_more_than_what_looks_like_it(
    other: Fit, sprung: Fit, taken: bool
) -> None:
    springs = SimpleNamespace(fit=lambda: sprung)
    problem: Any = SimpleNamespace(arm=SimpleNamespace(n=3), sprung=lambda: springs)
    assert earned(problem, fit_of(0.3, 0.3, 0.3, faults=1), other) is taken


@pytest.mark.parametrize(
    ("degrees", "error", "taken"),
    [
        (2.0, 0.3, True),
        (2.0, 0.5, False),
        (0.9, 0.01, False),
        (1.1, 0.01, True),
        (19.0, 0.1, True),
        (21.0, 0.1, None),
        (21.0, 0.4, None),
        # which it may not be
        (21.0, 0.6, True),
    ],
)
def test_a_lean_is_more_than_a_degree_and_its_error(
    degrees: float, error: float, taken: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of more than twenty degrees is another mounting."""
    down = np.array([np.sin(np.radians(degrees)), 0.0, -np.cos(np.radians(degrees))])
    found = Direction(down, np.eye(3)[:2], np.diag([np.radians(error) ** 2] * 2))
    better, plain = fit_of(0.1, 0.1), fit_of(0.3, 0.3)
    leaning = SimpleNamespace(left=lambda: better, fit=lambda: better)
    level = SimpleNamespace(left=lambda: plain, fit=lambda: plain)
    problem: Any = SimpleNamespace(
        arm=SimpleNamespace(n=2, gravity=np.array([0.0, 0.0, -9.81])),
        under=lambda other: leaning if other @ down > 0.9999 else level,
        sprung=lambda: level,
        left=lambda: plain,
    )
    problem.every = lambda step: problem
    leaning_so = mounting.Mounting.leaning(found, np.array([0.0, 0.0, -1.0]))
    monkeypatch.setattr(mounting, "refined", lambda problem, first: [leaning_so])
    monkeypatch.setattr(mounting, "nearby", lambda times, first: down)
    told = mounting.other_mounting(problem, plain)
    assert (told is not None and told.slight) is (taken is True)


def test_angles_of_a_direction_and_their_errors() -> None:
    down = np.array([0.0, 0.0, -1.0])
    direction = Direction(down, np.eye(3)[:2], np.diag([0.01, 0.0004]))
    aside: Any = np.array([np.sin(0.3), 0.0, -np.cos(0.3)])
    assert direction.beside(aside) == pytest.approx(0.3)
    assert direction.beside(-down) == pytest.approx(np.pi)
    assert direction.standardised(aside) == pytest.approx(np.sin(0.3) / 0.1)
    assert direction.std_error == pytest.approx(0.1)


def test_errors_of_a_direction_are_as_large_as_disturbances_that_last_make_them() -> None:
    """Those of single instants would be too small by the root of the instants in a block, some six times."""
    arm, given, sizes = three_axis(), np.array([0.0, 0.0, -1.0]), []
    for seed in range(1, 13):
        motion = fourier_motion(80.0, 100.0, seed)
        tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + 0.3 * np.sign(motion.v)
        lasting = np.repeat(np.random.default_rng(seed).standard_normal((80, 3)), 100, axis=0)
        log = recorded(motion, tau + 0.05 * np.mean(np.abs(tau), axis=0) * lasting, seed)
        problem = PlainFits.of([log], arm, 10.0)
        assert problem is not None
        (leaning,) = refined(problem, [mounting.Mounting(given)])
        assert leaning.lean is not None
        sizes.append(leaning.lean.standardised(given))
    # of two independent standardised angles: root two
    assert 0.5 < np.sqrt(np.mean(np.square(sizes)) / 2) < 2.0
