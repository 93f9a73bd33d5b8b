"""Rest as event detection sees it: a joint that stands, and not one that turns round fast within the filter's reach."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from stretches import motion, steps

from armloop.data.creep import STICKING as CREEP
from armloop.data.motion import Motion, Samples
from armloop.diagnosis import innovations
from armloop.identification.standstill import at_rest
from armloop.util.errors import ModelError


def samples(v: np.ndarray, moving: np.ndarray) -> Samples:
    """One joint at 100 Hz, filtered at 5 Hz: a standstill smears its torque by 0.1 s."""
    time = 0.01 * np.arange(len(v))
    motion = Motion(
        time, np.cumsum(v)[:, None] * 0.01, v[:, None], np.gradient(v, 0.01)[:, None], np.array([0])
    )
    return Samples(motion, np.zeros((len(v), 1)), moving[:, None], 0.01, 5.0)


def of_samples(given: Any) -> Any:
    """Evidence of a model that does not know how fast its joints go."""
    joints = given.motion.v.shape[1]
    return SimpleNamespace(samples=given, model=SimpleNamespace(history={}, arm=SimpleNamespace(n=joints)))


def resting(given: Any) -> Any:
    return at_rest(given.samples, given.model)


def test_a_joint_that_never_crept_may_stick_at_more_than_its_sliding_level() -> None:
    def of(**history: Any) -> list[float]:
        model: Any = SimpleNamespace(history=history, arm=SimpleNamespace(n=3))
        return innovations.stiction(model).tolist()  # type: ignore[no-any-return]

    ranges = [[1.0] * 3, [2.0] * 3, [9.0] * 3, [0.0] * 3]
    # five hundredths of the largest speed, or slower, is creep
    assert of(range=ranges, slowest=[0.02, 0.1, 0.11]) == [1.2, 1.2, 1.8]
    assert of(range=ranges) == of(slowest=[0.5] * 3) == [1.2] * 3


def test_a_fast_reversal_is_no_rest_and_a_standstill_is() -> None:
    turning = np.linspace(-2.0, 2.0, 200)
    near = (
        np.abs(np.arange(200) - 99.5) <= 10.5
    )  # the samples whose torque the filter has mixed with the standstill's
    assert resting(of_samples(samples(turning, ~near))).sum() <= 2 < near.sum()
    standing = np.concatenate([np.linspace(2.0, 0.0, 100), np.zeros(100), np.linspace(0.0, 2.0, 100)])
    still = np.zeros(300, dtype=bool)
    still[90:210] = True
    rest = resting(of_samples(samples(standing, ~still)))[:, 0]
    assert rest[100:200].all() and not rest[:98].any() and not rest[202:].any()
    assert np.abs(standing[rest]).max() <= 2 * CREEP + 0.02


def test_a_standstill_as_long_as_what_the_filter_smears_to_both_sides_is_a_rest_of_that_joint() -> None:
    """The filter reaches ten samples: of a standstill rests what is farther than that from where the joint moves."""
    N = 120
    v = np.ones((N, 2))
    moving = np.ones((N, 2), dtype=bool)
    moving[20:35, 0] = moving[50:80, 0] = moving[105:, 0] = False
    moving[82:104, 1] = False
    motion = Motion(0.01 * np.arange(N), 0 * v, v, 0 * v, np.array([0, 20]))
    given = Samples(motion, 0 * v, moving, 0.01, 5.0)
    assert round(given.reach / given.period) == 10
    rest = np.zeros((N, 2), dtype=bool)
    # neither a run's beginning nor its end is a motion
    rest[[*range(20, 25), *range(60, 70), *range(115, 120)], 0] = rest[92:94, 1] = True
    np.testing.assert_array_equal(resting(of_samples(given)), rest)
    # without a filter nothing is smeared, and slower than a creep a joint rests
    v[0], v[1], v[2] = CREEP, -0.99 * CREEP, 0.99 * CREEP
    moving[:3] = True
    rest = ~moving
    rest[1:3] = True
    bare = of_samples(Samples(motion, 0 * v, moving, 0.01))
    np.testing.assert_array_equal(resting(bare), rest)
    # a joint that never went faster than a twentieth of this in training is not at rest there
    bare.model.history = {"range": [[1.0, 1.0], [10 * CREEP, 20 * CREEP], [1.0, 1.0], [0.0, 0.0]]}
    rest[1:3, 0] = False
    np.testing.assert_array_equal(resting(bare), rest)


def at_speeds(v: list[float], starts: tuple[int, ...] = (0,), **of: Any) -> Any:
    """Evidence of one joint of a baseline of 1 N·m, sampled every 0.04 s and not filtered."""
    given = np.array(v)[:, None]
    time = 0.04 * np.arange(len(v))
    motion = Motion(time, 0 * given, given, 0 * given, np.array(starts))
    moving = np.ones(given.shape, dtype=bool)
    samples = SimpleNamespace(
        motion=motion, cutoff_hz=0.0, period=0.04, reach=of.get("reach", 0.0), moving=moving
    )
    model = SimpleNamespace(
        history=of.get("history", {}),
        friction=of.get("friction"),
        predict=of.get("predict"),
        baseline=of.get("baseline", {}),
        arm=SimpleNamespace(n=1),
    )
    context = SimpleNamespace(load=of.get("load"), predicted=of.get("predicted"))
    rows = np.ones(given.shape, dtype=bool)
    return SimpleNamespace(
        samples=samples,
        model=model,
        context=context,
        rows=rows,
        scale=np.ones(1),
        unknown=of.get("unknown"),
        residual=lambda known: of.get("bare", 0.0),
    )


class TestInnovations:
    """Dry friction of 1 N·m, residuals and friction as they are given."""

    @staticmethod
    def found(
        monkeypatch: pytest.MonkeyPatch, v: list[float], residual: list[float], rest: list[bool], **of: Any
    ) -> list[float]:
        friction = SimpleNamespace(torque=lambda motion, load: np.array(of["held"])[:, None])
        given = {key: of[key] for key in ("history", "unknown", "baseline") if key in of}
        evidence = at_speeds(v, friction=friction, **given)
        evidence.rows[:, 0] = of.get("rows", True)
        known = of.get("known", ())
        level = 1.0 + len(known)
        monkeypatch.setattr(innovations, "dry_level", lambda e, known: np.full((len(v), 1), level))
        monkeypatch.setattr(innovations, "shared_dry", lambda e, known, slow: of.get("shared", 0.0))
        monkeypatch.setattr(innovations, "at_rest", lambda samples, model: np.array(rest)[:, None])
        monkeypatch.setattr(innovations, "deviations", lambda evidence, residual: 0 * residual + 2.0)
        values, rests = innovations.innovations(evidence, np.array(residual)[:, None], known)
        assert rests[:, 0].tolist() == rest
        return values[:, 0].tolist()

    def test_a_joint_that_slides_has_its_whole_residual_and_one_that_creeps_what_friction_leaves(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        history = {"range": [[9.0], [2.0], [9.0], [9.0]]}  # creeping below 0.05 * 2 rad/s
        v, residual = [5.0, -5.0, 0.1, -0.1, 0.0], [3.0, 3.0, 3.0, 3.0, 0.7]
        found = self.found(
            monkeypatch, v, residual, [False] * 5, held=[0.0] * 5, history=history, rows=np.eye(5)[4] > 0
        )
        near = (3 - 0.8 * np.exp(-1)) / 2
        np.testing.assert_allclose(found, [1.5, 1.5, near, near, 0.0])
        # of a model that does not tell its range: below 0.01 rad/s
        found = self.found(
            monkeypatch, [5.0, 0.01], [3.0, 3.0], [False] * 2, held=[0.0] * 2, rows=[False, False]
        )
        np.testing.assert_allclose(found, [1.5, near])
        # along a direction that it shares it may rest, though it slides
        found = self.found(
            monkeypatch,
            v,
            residual,
            [False] * 5,
            held=[0.0] * 5,
            history=history,
            rows=np.eye(5)[4] > 0,
            shared=1.2,
        )
        np.testing.assert_allclose(found, [0.9, 0.9, near - 0.6, near - 0.6, 0.0])
        # a joint that never moved had no speed
        history["range"][1] = [0.0]
        found = self.found(
            monkeypatch,
            [5.0, 0.0],
            [3.0, 3.0],
            [False] * 2,
            held=[0.0] * 2,
            history=history,
            rows=[False] * 2,
        )
        np.testing.assert_allclose(found, [1.5, 1.1])

    def test_a_joint_slower_than_it_slid_in_the_training_logs_may_rub_as_at_rest(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Whatever they left of faster creeping: a wrist that other joints drag along is no event."""
        history = {"range": [[9.0], [2.0], [9.0], [9.0]], "slowest": [0.1]}
        v, residual = [0.04, -0.04, 0.04, 0.06], [0.7, -0.7, 3.0, 3.0]
        found = self.found(
            monkeypatch,
            v,
            residual,
            [False] * 4,
            held=[0.0] * 4,
            history=history,
            rows=[False] * 4,
            baseline={"creeping": [0.01]},
        )
        np.testing.assert_allclose(found, [0.0, 0.0, 1.1, (3 - 0.03 * np.exp(-0.36)) / 2])

    def test_what_is_known_of_a_creeping_joint_is_what_the_training_logs_left(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def near(left: float | None, extra: float = 0.0) -> float:
            # all of the run's sliding samples show so much more friction
            (value,) = self.found(
                monkeypatch,
                [0.1],
                [3.0],
                [False],
                held=[0.0],
                history={"range": [[9.0], [2.0], [9.0], [9.0]]},
                rows=[extra > 0],
                baseline={"creeping": [left]},
            )
            return 3 - 2 * value

        # three times that, and no more than four fifths of the dry friction
        assert near(0.1) == pytest.approx(0.3 * np.exp(-1)) and near(0.0) == 0.0
        assert near(0.3) == near(None) == pytest.approx(0.8 * np.exp(-1))
        # friction that has risen by 3 N·m may stand for it: of 4 there are four fifths
        assert near(0.0, 3.0) == pytest.approx(3.0 * np.exp(-1))
        assert near(0.1, 3.0) == near(None, 3.0) == pytest.approx(3.2 * np.exp(-1))

    def test_at_rest_friction_holds_a_fifth_more_with_the_models_own_or_without(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        none = np.zeros(4, dtype=bool)
        residual, held = [3.0, 3.0, 3.0, 3.0], [0.0, -1.0, 5.0, -6.0]
        found = self.found(monkeypatch, [0.0] * 4, residual, [True] * 4, held=held, rows=none)
        # the smaller of 3 - 1 and |residual + friction| - 1.2, with the sign of the latter
        np.testing.assert_allclose(found, [0.9, 0.4, 1.0, -0.9])
        # nor is it known how much a joint holds that never crept in its training
        ranges = [[1.0], [2.0], [9.0], [0.0]]
        found = self.found(
            monkeypatch,
            [0.0],
            [3.0],
            [True],
            held=[0.0],
            rows=False,
            history={"range": ranges, "slowest": [0.2]},
        )
        np.testing.assert_allclose(found, (3 - 1.8) / 2)
        # of what is known beside the model, what rubs is held, too: as much more, and with its torque there or without
        rubs, pulls = (
            SimpleNamespace(
                effect=SimpleNamespace(rubs=is_friction), torque=lambda context: np.full((4, 1), -2.0)
            )
            for is_friction in (True, False)
        )
        one = {"residual": [9.0] * 4, "rest": [True] * 4, "held": [0.0] * 4, "rows": none}
        found = self.found(monkeypatch, [0.0] * 4, known=[pulls], **one)
        np.testing.assert_allclose(found, (9 - 1.2 * 2) / 2)
        found = self.found(monkeypatch, [0.0] * 4, known=[rubs], **one)
        np.testing.assert_allclose(found, (9 - 2 - 1.2 * 2) / 2)
        # what is within friction is nothing
        found = self.found(
            monkeypatch, [0.0] * 4, [0.9, -0.9, 1.1, 0.0], [True] * 4, held=[0.0] * 4, rows=none
        )
        assert np.abs(found).tolist() == [0.0] * 4

    def test_where_sliding_takes_more_than_the_model_says_so_does_sticking(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        v, rest = [5.0, -5.0, 5.0, 0.0], [False] * 3 + [True]
        for sign in (1.0, -1.0):
            residual = [sign * 0.5, -sign * 0.5, sign * 0.5, 3.0]
            found = self.found(monkeypatch, v, residual, rest, held=[0.0] * 4, rows=[True] * 3 + [False])
            np.testing.assert_allclose(found[3], (3 - 1.2 * 1.5) / 2)

    def test_what_is_not_known_is_none(self, monkeypatch: pytest.MonkeyPatch) -> None:
        unknown = np.array([[True], [False]])
        found = self.found(
            monkeypatch,
            [5.0, 5.0],
            [3.0, -3.0],
            [False] * 2,
            held=[0.0] * 2,
            unknown=unknown,
            rows=[False] * 2,
        )
        assert found == [0.0, -1.5]


class TestDeviations:
    @pytest.fixture(autouse=True)
    def no_contradiction(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(innovations, "contradiction", lambda model, motion: np.zeros((1, 1)))

    def test_torque_and_motion_may_be_half_a_sample_apart(self) -> None:
        predicted = 30.0 * 0.04 * np.arange(12.0)[:, None]
        predicted[8:] *= 2
        evidence = at_speeds([1.0] * 12, (0, 8, 10), predicted=predicted)
        found = innovations.deviations(evidence, 0 * predicted)[:, 0]
        # of runs of two samples the slope is not asked
        late = 30.0 * 0.5 * 0.04
        np.testing.assert_allclose(found, [np.hypot(1.0, late)] * 8 + [1.0] * 4)
        evidence = at_speeds([1.0] * 3, predict=lambda motion: predicted[:3])
        np.testing.assert_allclose(
            innovations.deviations(evidence, np.zeros((3, 1)))[:, 0], [np.hypot(1.0, late)] * 3
        )
        evidence.scale = np.array([1e-13])
        evidence.model.predict = lambda motion: 0 * predicted[:3]
        np.testing.assert_allclose(innovations.deviations(evidence, np.zeros((3, 1)))[:, 0], [1e-12] * 3)

    def test_what_effects_supply_is_known_but_for_a_part_of_it(self) -> None:
        bare, left = np.full((4, 1), 20.0), np.array([[20.0], [0.0], [40.0], [10.0]])
        evidence = at_speeds([1.0] * 4, predicted=0 * bare, bare=bare)
        part = np.sqrt(0.003) * np.array([0.0, 20.0, 20.0, 10.0])
        np.testing.assert_allclose(innovations.deviations(evidence, left)[:, 0], np.hypot(1.0, part))

    def test_an_average_of_the_runs_own_noise_may_be_more_than_the_baseline(self) -> None:
        # means over five of the samples, ±1 in turn, are ±1/5
        residual = 10 * np.where(np.arange(100) % 2, -1.0, 1.0)[:, None]
        evidence = at_speeds([1.0] * 100, predicted=0 * residual, reach=0.05, bare=residual)
        assert innovations.deviations(evidence, residual)[50, 0] == 1.0  # no time series
        evidence.samples.cutoff_hz = 1e-9
        evidence.samples.motion = at_speeds([1.0] * 100, tuple(range(0, 100, 10))).samples.motion
        noise = 1.4826 * 10 * (1 - 1 / 5)

        def deviation() -> float:
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(innovations, "smooth", lambda samples, x: x)
                return float(innovations.deviations(evidence, residual)[5, 0])

        # four times the filter's reach in 0.2 s; never fewer than one
        assert deviation() == pytest.approx(noise / 2)
        evidence.samples.reach = 0.3
        assert deviation() == pytest.approx(noise)
        evidence.rows[:] = False
        assert deviation() == 1.0
        evidence.rows[5] = True
        assert deviation() == pytest.approx(noise)


def test_a_contradiction_is_the_skew_part_of_the_mass_times_the_acceleration(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    motion: Any = SimpleNamespace(q=np.zeros((1, 2)), vdot=np.array([[1.0, 10.0]]))
    mass = np.array([[[1.0, 2.0], [4.0, 3.0]]])
    model: Any = None
    monkeypatch.setattr(innovations, "Dynamics", lambda model: SimpleNamespace(mass_matrix=lambda q: mass))
    assert innovations.contradiction(model, motion).tolist() == [[-10.0, 1.0]]

    def none(model: Any) -> Any:
        raise ModelError("not linear in the acceleration")

    monkeypatch.setattr(innovations, "Dynamics", none)
    assert innovations.contradiction(model, motion).tolist() == [[0.0, 0.0]]


def test_a_window_is_a_fifth_of_a_second_and_at_least_a_sample() -> None:
    evidence = at_speeds([0.0] * 11)
    values = np.eye(11)[:, [5]]
    for period, width in ((0.04, 5), (0.06, 3), (1.0, 1)):
        evidence.samples.period = period
        mean = innovations.averaged(evidence.samples, values)[:, 0]
        np.testing.assert_allclose(
            mean, np.where(np.abs(np.arange(11) - 5) <= width // 2, 1 / width, 0), atol=1e-12
        )


class TestPieces:
    def test_a_running_mean_stays_within_its_run(self) -> None:
        samples: Any = SimpleNamespace(motion=motion([50, 50], 0.04), period=0.04)
        values = steps(100, (48, 49, 5.0), (70, 70, 10.0))
        mean = innovations.averaged(samples, values[:, None])[:, 0]
        np.testing.assert_allclose(mean[68:73], 2.0)
        np.testing.assert_allclose(mean[[45, 50, 67, 73]], 0.0, atol=1e-12)
        assert mean[49] == pytest.approx(4 * 5.0 / 5)

    def test_a_standstill_is_eroded_by_the_filters_reach_but_creeping_rests(self) -> None:
        given = motion([40, 60], 0.01)
        given.v[:] = 1.0
        given.v[90] = 0.005
        moving = np.ones((100, 1), dtype=bool)
        moving[10:31] = False
        moving[50:] = False
        moving[75] = True
        samples: Any = SimpleNamespace(motion=given, moving=moving, period=0.01, reach=0.03, cutoff_hz=5.0)
        rest = np.flatnonzero(resting(of_samples(samples))).tolist()
        assert rest == [*range(13, 28), *range(53, 72), *range(79, 100)]
        samples.cutoff_hz = 0.0
        rest = np.flatnonzero(resting(of_samples(samples))).tolist()
        assert rest == [*range(10, 31), *range(50, 75), *range(76, 100)]
