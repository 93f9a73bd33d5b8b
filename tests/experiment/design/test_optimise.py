"""Optimised motions keep every limit on a finer grid than they were optimised on, and beat random ones."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.data.motion import Motion
from armloop.experiment.design import (
    CRITERIA,
    Excitation,
    Limits,
    Problem,
    Regression,
    Series,
    Settings,
    data_ratio,
    excite,
    nominal_torque,
    optimise,
    random_references,
    sampled,
)
from armloop.experiment.design.optimise import Objective
from armloop.experiment.excitation import MotionRanges
from armloop.robot.arm import Arm, load_arm
from armloop.util.errors import InputError

Array = np.ndarray


def with_effort(arm: Arm, share: float) -> Arm:
    """The arm with weaker drives."""
    return replace(arm, joints=tuple(replace(joint, effort=share * joint.effort) for joint in arm.joints))


@pytest.fixture(scope="module")
def made() -> Excitation:
    """A reference for an arm whose drives nobody knows."""
    arm = with_effort(load_arm("three_axis"), np.inf)
    return excite(arm, MotionRanges.of(arm), Settings(duration=6.0, starts=1, random=3))


@pytest.mark.parametrize(
    ("name", "effort", "library", "duration"),
    [
        ("three_axis", 1.0, "rigid-body", 8.0),
        ("three_axis", 0.25, "rigid-body", 8.0),  # 8 of 40 N·m at the shoulder: gravity alone takes up to 9
        ("scara", 0.06, "rigid-body", 8.0),
    ],
)
def test_limits_hold_between_the_samples_and_random_ones_are_beaten(
    name: str, effort: float, library: str, duration: float
) -> None:
    arm = with_effort(load_arm(name), effort)
    ranges = MotionRanges.of(arm)
    made = excite(arm, ranges, Settings(library=library, duration=duration, starts=1, random=4))
    t = np.arange(0.0, duration, 0.0011)
    q, v, vdot = made.reference.evaluate(t)
    assert np.all(q >= ranges.lower) and np.all(q <= ranges.upper)
    assert np.all(np.abs(v) <= ranges.velocity) and np.all(np.abs(vdot) <= ranges.acceleration)
    tau = nominal_torque(arm)(Motion(t, q, v, vdot, np.array([0])))
    assert np.all(np.abs(tau) <= 0.8 * np.array([joint.effort for joint in arm.joints]))
    # the worst use of each limit that it reports is what is found here, and every joint is driven to one
    assert_allclose(made.use[1], np.abs(v / ranges.velocity).max(axis=0), rtol=1e-3)
    assert np.all(made.use[:3].max(axis=0) > 0.5)
    if effort == 0.25:
        assert made.use[3].max() > 0.9
    assert made.measure.error < min(m.error for m in made.random)


def test_the_gradient_is_the_derivative() -> None:
    arm = load_arm("scara")
    ranges = MotionRanges.of(arm)
    # weak drives, so that the torque's penalty is at work too
    limits = Limits(ranges, np.array([0.2, 0.1, 2.0, 0.01]), nominal_torque(arm))

    def columns(motion: Motion) -> Array:
        waves = [np.sin(motion.q), motion.v * np.cos(motion.q), motion.vdot, motion.v**2]
        return np.concatenate([x[:, :, None] * np.eye(4) for x in waves], axis=2)

    series = Series(4, 4, 6.0)
    typical = [
        sampled(series.reference(0.3 * np.random.default_rng(k).normal(size=(4, 7))), 0.05) for k in range(3)
    ]
    regression = Regression.of(columns, [f"c{k}" for k in range(16)], np.array([1.0, 2.0, 3.0, 0.5]), typical)
    objective = Objective(Problem(series, regression, CRITERIA["variance"], limits), weight=10.0)
    rng = np.random.default_rng(0)
    x = 0.8 * rng.normal(size=(4, series.free))
    _, gradient = objective(x)
    for _ in range(4):
        way = rng.normal(size=x.shape)
        difference = (objective(x + 1e-6 * way)[0] - objective(x - 1e-6 * way)[0]) / 2e-6
        assert_allclose(difference, np.sum(gradient * way), rtol=1e-3, atol=1e-4)


def test_scaled_information_does_not_depend_on_units() -> None:
    rng = np.random.default_rng(0)
    motions = [sampled(Series(2, 3, 4.0).reference(rng.normal(size=(2, 5))), 0.05) for _ in range(3)]

    def columns(unit: Array) -> Array:
        return lambda motion: np.stack([motion.q, motion.v, motion.vdot, motion.v**2], axis=2) * unit

    plain = Regression.of(columns(np.ones(4)), list("abcd"), np.array([0.5, 2.0]), motions)
    other = Regression.of(columns(np.array([1e3, 1, 1e-4, 7])), list("abcd"), np.array([0.5, 2.0]), motions)
    assert_allclose(plain.information(motions[0]), other.information(motions[0]), atol=1e-12)
    assert_allclose(np.mean([np.diag(plain.information(m)) for m in motions], axis=0), 1.0)


def test_columns_that_cannot_be_excited_are_left_out() -> None:
    series = Series(2, 3, 4.0)
    motions = [
        sampled(series.reference(np.random.default_rng(k).normal(size=(2, 5))), 0.05) for k in range(3)
    ]

    def columns(motion: Motion) -> Array:
        q = motion.q
        return np.stack([q, 2 * q, motion.v, 0 * q, 3 * q + motion.v], axis=2)

    assert Regression.of(columns, list("abcde"), np.ones(2), motions).count == 2


def test_a_motion_that_tells_two_effects_apart() -> None:
    """A spring and gravity at one joint: the same over a small range, told apart by a wide one."""
    arm = load_arm("three_axis")
    ranges = MotionRanges.of(arm)
    limits = Limits(ranges, np.full(3, np.inf), nominal_torque(arm))

    def columns(motion: Motion) -> Array:
        q = motion.q[:, 1]
        return np.stack([q, np.sin(q), np.ones_like(q), motion.v[:, 1]], axis=1)[:, None, :]

    typical = [sampled(reference, 0.05) for reference in random_references(limits, 10.0, 8, 0)]
    regression = Regression.of(columns, ["spring", "gravity", "1", "v"], np.ones(1), typical, required=(0, 1))
    problem = Problem(Series(3, 4, 10.0), regression, CRITERIA["logdet"], limits)
    design = problem.optimise(2, 0)
    assert design is not None
    assert design.value > max(problem.value(reference) for reference in random_references(limits, 10.0, 8, 0))
    assert np.ptp(design.reference.evaluate(np.linspace(0, 10, 500))[0][:, 1]) > 0.95 * np.ptp(
        [ranges.lower[1], ranges.upper[1]]
    )


def test_a_seed_is_a_reference(made: Excitation) -> None:
    problem = Problem(Series(3, 6, 6.0), made.regression, CRITERIA["logdet"], made.limits)
    designs = [problem.optimise(1, seed, effort=0.05) for seed in (1, 1, 2)]
    first, again, other = (design.reference.cosine for design in designs if design is not None)
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_iterations_are_counted_over_stages_and_starts(
    made: Excitation, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(optimise, "paced", lambda progress: progress)
    monkeypatch.setattr(optimise, "_STAGES", ((30.0, 2), (1e3, 1)))
    problem = Problem(Series(3, 6, 6.0), made.regression, CRITERIA["logdet"], made.limits)
    problem.optimise(2, 1, progress=said.append)
    counted = [int(line.split()[1]) for line in said if line.startswith("iteration")]
    assert counted == [1, 2, 3, 4, 5, 6]
    assert said[0] == "iteration 1 of at most 6" and said[3].startswith("start 1 of 2: ")


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"criterion": "size"}, "unknown criterion 'size'; there are: logdet, variance, condition"),
        ({"library": "lagrangian"}, "no motion can be designed for library 'lagrangian'"),
        ({"duration": 1.0}, "duration too short: 6 harmonics"),
        ({"duration": 5.0, "base_frequency": 0.1}, "duration too short: 5 s is less than one period"),
        ({"duration": 25.0, "base_frequency": 0.1}, "no whole number of periods"),
        ({"duration": float("nan")}, "duration nan"),
        ({"harmonics": 2}, "harmonics 2"),
        ({"reserve": 1.0}, "reserve 1"),
        ({"noise": (1.0, 0.0, 1.0)}, "noise must be 3 positive numbers"),
        ({"order": 7}, "order 7"),
    ],
)
def test_settings_out_of_range(settings: dict, says: str) -> None:
    arm = load_arm("three_axis")
    with pytest.raises(InputError, match=says):
        excite(arm, MotionRanges.of(arm), Settings(**settings))


def test_an_arm_that_cannot_hold_itself() -> None:
    arm = load_arm("three_axis")
    ranges = replace(MotionRanges.of(arm), lower=np.array([-1, -0.2, -0.2]), upper=np.array([1, 0.2, 0.2]))
    with pytest.raises(InputError, match="no motion is within the limits: resting anywhere takes at least"):
        excite(with_effort(arm, 0.05), ranges, Settings())


def test_an_arm_that_can_hardly_hold_itself_is_told_which_joint_is_too_weak() -> None:
    """A URDF with the same effort at every joint, for want of a number: one posture in a hundred can be held."""
    arm = load_arm("three_axis")
    arm = replace(arm, joints=tuple(replace(joint, effort=0.4) for joint in arm.joints))
    says = r"hardly any motion .*: joint 'joint_2' may give 0\.32 N.m, and rest alone takes more in 9\d % .*, up to 7\.3"
    with pytest.raises(InputError, match=says):
        excite(arm, MotionRanges.of(arm), Settings(library="rigid-body"))


def test_an_arm_without_effort_limits_is_told_so(made: Excitation) -> None:
    assert any("the torque there is unbounded" in note for note in made.notes)
    assert not made.use[3].any()


def test_the_data_ratio_counts_trajectories(made: Excitation) -> None:
    """A motion with four times the information saves a factor of about four, whatever the noise."""
    motion = made.period_motion(0.05)
    copies = [motion] * 12
    same = data_ratio(made.regression, motion, copies, 0, noises=1000)
    assert_allclose(same.median, 1.0, atol=0.15)
    longer = Motion.joined([motion] * 4)
    assert_allclose(data_ratio(made.regression, longer, copies, 0, noises=1000).median, 4.0, atol=0.5)
    assert same.to_dict()["most"] == 12
