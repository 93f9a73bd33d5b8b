"""The motion to make next: made, logged and diagnosed, it names what is there and rids the list of the rest."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, write_log
from armloop.data.motion import Motion
from armloop.data.signals import preprocess
from armloop.diagnosis import Diagnosis, diagnose
from armloop.diagnosis.next_run import Wish, next_run, training_ranges
from armloop.experiment.excitation import MotionRanges, Reference, read_reference
from armloop.identification.scoring import score
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError

Law = Callable[[Motion], np.ndarray]
COULOMB, VISCOUS = 0.5, 1.5


def two_joints() -> Arm:
    """The first two links of the three-axis arm."""
    arm = three_axis()
    cut = {key: getattr(arm, key)[:2] for key in ("X_PF", "axis", "mass", "com", "inertia")}
    return replace(arm, name="two", joints=arm.joints[:2], X_tool=np.eye(4), urdf="", **cut)


ARM = two_joints()
RANGES = [[1.2, 1.0], [1.2, 1.2], [2.5, 2.5], [0.0, 0.1]]  # half of q, v, vdot, centre of q


def total(motion: Motion) -> np.ndarray:
    """What the drives supply on the bare arm."""
    rigid = rigid_torque(ARM, motion.q, motion.v, motion.vdot)
    return rigid + COULOMB * np.sign(motion.v) + VISCOUS * motion.v


def on_joint_2(torque: np.ndarray) -> np.ndarray:
    return np.column_stack([np.zeros_like(torque), torque])


def spring(motion: Motion) -> np.ndarray:
    """2 N·m/rad from -0.3 rad."""
    return on_joint_2(2.0 * (motion.q[:, 1] + 0.3))


def offset(motion: Motion) -> np.ndarray:
    return on_joint_2(np.full(motion.samples, 0.4))


def encoder(motion: Motion) -> np.ndarray:
    """Joint 2 reads 0.06 rad too much."""
    return total(replace(motion, q=motion.q - np.array([0.0, 0.06]))) - total(motion)


def unlisted(motion: Motion) -> np.ndarray:
    return on_joint_2(0.8 * np.cos(2 * motion.q[:, 1]) * motion.v[:, 0])


def small_motion(seed: int, size: float) -> Motion:
    """About one posture."""
    m = fourier_motion(24.0, 125.0, seed, ARM, size=size)
    return Motion(m.time, m.q + np.array([0.3, 0.4]), m.v, m.vdot, m.starts)


def motion_of(reference: Reference) -> Motion:
    t = np.arange(0.0, reference.duration, 0.008)
    return Motion(t, *reference.evaluate(t), np.array([0]))


def log(motion: Motion, law: Law | None, seed: int) -> MotionLog:
    return measured(motion, total(motion) + (law(motion) if law else 0.0), seed)


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    """The arm as it is, trained within ranges."""
    body = RigidBody(nominal_parameters(ARM), (), np.zeros(0))
    friction = FrictionLaw(((FrictionTerm("sign", COULOMB), FrictionTerm("viscous", VISCOUS)),) * 2)
    bare = ReconstructedModel(ARM, (body,), friction, history={"range": RANGES})
    clean = log(fourier_motion(40.0, 125.0, 90, ARM), None, 90)
    return replace(bare, baseline=score(bare, preprocess([clean], bare.conditioning)).moving)


def check_limits(reference: Reference, ranges: MotionRanges) -> None:
    q, v, vdot = reference.evaluate(np.arange(0.0, reference.duration, 0.0013))
    assert np.all(q >= ranges.lower) and np.all(q <= ranges.upper)
    assert np.all(np.abs(v) <= ranges.velocity) and np.all(np.abs(vdot) <= ranges.acceleration)
    # it begins and ends at rest, as does every period
    for _, still, pull in (reference.evaluate([t]) for t in (0.0, 20.0, reference.duration - 1e-9)):
        assert np.abs(still).max() < 1e-6 and np.abs(pull).max() < 1e-6


def labels(diagnosis: Diagnosis) -> list[str]:
    return [found.effect.label() for found in diagnosis.outcome.found]


CASES: dict[str, tuple[Law, float, str]] = {
    # on a range of a few hundredths of a radian a spring is a constant, or half a period of a ripple
    "spring": (spring, 0.02, "joint_spring at joint 2"),
    # its torque is what the known model says of another posture
    "encoder": (encoder, 0.2, "encoder_offset at joint 2"),
}


@pytest.mark.parametrize("case", ["spring", pytest.param("encoder", marks=pytest.mark.long)])
def test_the_next_run_names_what_is_there_and_has_no_such_alternatives(model, case) -> None:
    law, size, truth = CASES[case]
    first = diagnose(model, [log(small_motion(3, size), law, 3)])
    assert first.verdict == "effects_found"
    # of one start alone the local optimum hangs on the processor's last digits
    made = next_run(first, Wish(duration=40.0))
    assert made is not None and made.purpose == "alternatives"
    told = [each for each in made.told if each.then is not None]
    assert len(told) >= 1 and all(each.now < 0.3 for each in told)
    # what has several free parameters imitates the others with them
    least = [0.15 if "payload" in (each.found.name, each.rival.name) else 0.2 for each in told]
    assert all(each.then > max(2 * each.now, bar) for each, bar in zip(told, least, strict=True))
    assert [each.now for each in told] == sorted(each.now for each in told)
    check_limits(made.reference, training_ranges(model))
    second = diagnose(model, [log(motion_of(made.reference), law, 13)])
    assert labels(second) == [truth]
    gone = {each.rival.label() for each in told} | {each.found.label() for each in told}
    # its five parameters still imitate a spring to a few per cent; it is not what is named
    gone -= {"payload"}
    assert not gone & {rival.label() for rival, _ in second.outcome.found[0].rivals}


def test_what_no_motion_tells_apart_is_said_and_the_rest_measured_better(model) -> None:
    found = diagnose(model, [log(small_motion(3, 0.3), offset, 3)])
    assert labels(found) == ["torque_offset at joint 2"]
    # only what the run itself cannot tell from it: the joint that rubs harder one way
    (only,) = (f for f in found.outcome.found)
    kept = [(rival, share) for rival, share in only.rivals if rival.name == "friction_asymmetry"]
    assert kept
    outcome = replace(found.outcome, found=[replace(only, rivals=kept)])
    made = next_run(replace(found, outcome=outcome), Wish(starts=1))
    assert made is not None and made.purpose == "precision"
    ((never,), ((effect, factor),)) = made.told, made.sharper
    assert (never.rival.name, never.then, effect.name) == ("friction_asymmetry", None, "torque_offset")
    assert never.now < 0.03 and 0 < factor < 1.2


def test_an_unlisted_residual_gets_its_joint_moved_everywhere_at_all_speeds(model) -> None:
    found = diagnose(model, [log(fourier_motion(40.0, 125.0, 5, ARM, size=0.5), unlisted, 5)])
    assert found.unlisted is not None and found.unlisted.joint == 2
    bare = replace(found, outcome=replace(found.outcome, found=[], after=found.outcome.before))
    made = next_run(bare, Wish(starts=1))
    assert made is not None and (made.purpose, made.joint) == ("unlisted", 2)
    ranges, motion = training_ranges(model), motion_of(made.reference)
    check_limits(made.reference, ranges)
    assert np.ptp(motion.q[:, 1]) > 0.9 * (ranges.upper - ranges.lower)[1]
    # slow and fast at every posture: of 4 x 4 boxes of position and speed hardly one is empty
    x = (motion.q[:, 1] - ranges.lower[1]) / (ranges.upper - ranges.lower)[1]
    boxes = np.histogram2d(x, np.abs(motion.v[:, 1]) / ranges.velocity[1], 4, [[0, 1], [0, 1]])[0]
    assert np.count_nonzero(boxes) >= 12


def test_a_clean_run_asks_for_no_motion_and_choices_out_of_range_are_refused(model) -> None:
    clean = diagnose(model, [log(fourier_motion(40.0, 125.0, 8, ARM), None, 8)])
    assert next_run(clean) is None
    for wish, says in (
        (Wish(duration=5.0), "next run of 5 s: a diagnosis needs 12 s"),
        (Wish(reserve=1.0), "reserve 1"),
    ):
        with pytest.raises(InputError, match=says):
            next_run(clean, wish)


def test_a_model_knows_its_arm_where_it_was_trained(model) -> None:
    ranges = training_ranges(model)
    np.testing.assert_allclose(ranges.lower, [-1.2, -0.9])
    np.testing.assert_allclose(ranges.upper, [1.2, 1.1])
    np.testing.assert_allclose(ranges.velocity, [1.2, 1.2])
    # never beyond the arm's own limits
    tight = tuple(replace(j, lower=-0.5, upper=0.5, velocity=1.0) for j in ARM.joints)
    ranges = training_ranges(replace(model, arm=replace(ARM, joints=tight)))
    np.testing.assert_allclose([*ranges.lower, *ranges.upper], [-0.5, -0.5, 0.5, 0.5])
    np.testing.assert_allclose(ranges.velocity, 1.0)
    # a model that does not say has its arm's
    silent = training_ranges(replace(model, history={}))
    np.testing.assert_allclose(silent.velocity, MotionRanges.of(ARM).velocity)


@pytest.fixture(scope="module")
def folder(model, tmp_path_factory):
    """A model, a run and what the command made of them, with narrower ranges than the model's."""
    folder = tmp_path_factory.mktemp("next")
    model.save(folder / "model.json")
    write_log(folder / "run.csv", log(small_motion(3, 0.01), spring, 3))
    return folder


def command(folder, *more: str) -> int:
    files = [str(folder / name) for name in ("model.json", "run.csv")]
    return main(["diagnose", *files, "--out", str(folder / "out"), *more])


def test_the_command_writes_the_reference_within_stated_limits(folder, capsys) -> None:
    path = folder / "next.csv"
    words = ["--next-run", str(path), "--velocity", "0.8,0.9", "--next-run-duration", "15"]
    assert command(folder, *words) == 0
    printed = capsys.readouterr().out
    assert "The motion to make next" in printed and "next run" in printed
    assert "No motion within the limits tells torque offset, joint 2, from friction asymmetry" in printed
    answer = json.loads((folder / "out" / "diagnosis.json").read_text())["next_run"]
    assert answer["reference"] == str(path) and answer["duration"] == 20.0  # whole periods
    assert {"found", "alternative", "apart"} == set(answer["alternatives"][0])
    assert np.max(answer["use"]["velocity"]) <= 1.0
    read = read_reference(path, 2)
    assert np.all(np.abs(read.v) <= [0.8, 0.9]) and np.all(np.abs(read.vdot) <= 2.5)
    assert np.all(read.q >= [-1.2, -0.9]) and np.all(read.q <= [1.2, 1.1])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--next-run", "next.txt"], "--next-run next.txt: a reference ends in .csv or .parquet"),
        (["--velocity", "1,1"], "ranges, reserve and duration are those of --next-run"),
        (["--next-run", "next.csv", "--velocity", "1,99"], "its URDF allows"),
        (["--next-run", "next.csv", "--lower", "1"], "give 2 numbers"),
    ],
)
def test_faults_are_found_before_any_work(folder, capsys, words, says) -> None:
    assert command(folder, *words) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert says in line
