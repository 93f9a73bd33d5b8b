"""Sums add, whatever the cut; a change is named from them alone; step and drift are told apart."""

from dataclasses import replace

import numpy as np
import pytest
from operation import Change, healthy_model, operate

from armloop.model import ReconstructedModel
from armloop.monitoring import sums as summing
from armloop.monitoring.catalogue import Column, watched
from armloop.monitoring.naming import Normal, name_change
from armloop.monitoring.sums import LogSums, log_sums
from armloop.monitoring.trend import course
from armloop.monitoring.units import Stream, Units, unit_edges
from armloop.monitoring.warmth import adjust
from armloop.util.errors import LogError


@pytest.fixture(scope="module")
def model() -> ReconstructedModel:
    return healthy_model()


def normal(parts: list[LogSums]) -> Normal:
    return Normal(
        np.array([part.gram.sum(axis=0) for part in parts]),
        np.array([part.moment.sum(axis=0) for part in parts]),
        np.array([part.energy.sum() for part in parts]),
    )


def test_the_columns_of_every_log_are_the_same(model: ReconstructedModel) -> None:
    first, second = (log_sums(model, operate(3, k)) for k in range(2))
    assert first.columns == second.columns
    assert [Column.of(column.key) for column in first.columns] == list(first.columns)
    names = {effect.name for effect, _ in watched(model)}
    assert {"payload", "viscous_friction", "coulomb_friction", "gravity_tilt", "time_delay"} <= names
    assert "friction_drift" not in names  # it has memory
    assert not {"upper_end_stop", "lower_end_stop"} & names  # beyond what was met while learning
    assert "coupling_spring" not in names


def test_an_arm_with_a_sliding_joint_is_watched_without_what_it_cannot_have(
    model: ReconstructedModel,
) -> None:
    joints = (*model.arm.joints[:2], replace(model.arm.joints[2], kind="prismatic"))
    places = {
        (e.name, e.joint, e.other_joint)
        for e, _ in watched(replace(model, arm=replace(model.arm, joints=joints)))
    }
    assert ("viscous_friction", 3, None) in places and ("transmission_coupling", 1, 2) in places
    assert ("transmission_coupling", 2, 3) not in places  # a turning and a sliding joint share no gears
    assert ("torque_ripple", 3, None) not in places


def test_least_squares_from_sums_are_those_of_the_samples(model: ReconstructedModel) -> None:
    # a coefficient written into the log comes out of Σ x u / Σ x²
    log = operate(3, 0)
    more = log.tau.copy()
    more[:, 1] += 0.7 * log.v[:, 1]
    before = log_sums(model, log)
    after = log_sums(model, type(log)(log.time, log.q, log.v, more, name="more"))
    (index,) = (i for i, c in enumerate(before.columns) if c.place == ("viscous_friction", 2, None))
    size = before.gram[:, index, index].sum()
    change = (after.moment[:, index].sum() - before.moment[:, index].sum()) / size
    assert change == pytest.approx(
        0.7, rel=5e-3
    )  # v as recorded has noise that the filter takes out of the column


def test_a_log_in_which_nothing_slides_is_refused_by_name(model: ReconstructedModel) -> None:
    log = operate(3, 0)
    rest = type(log)(log.time, 0 * log.q, 0 * log.v, log.tau, name="rest")
    with pytest.raises(LogError, match="rest: no joint slides"):
        log_sums(model, rest)


@pytest.mark.parametrize(
    ("change", "effect", "joint"),
    [
        (Change(mass=0.3), "payload", None),
        (Change(friction=np.array([0.0, 0.0, 0.15])), "viscous_friction", 3),
    ],
    ids=["load", "friction"],
)
def test_a_change_is_named_from_sums_alone(
    model: ReconstructedModel, change: Change, effect: str, joint: int | None
) -> None:
    healthy = normal([log_sums(model, operate(5, k)) for k in range(10)])
    window = normal([log_sums(model, operate(5, k, change)) for k in range(10, 18)])
    first, *_ = name_change(model.arm, log_sums(model, operate(5, 0)).columns, healthy, window)
    assert first.place[:2] == (effect, joint)
    if effect == "payload":
        assert float(first.parameters["mass"].value) == pytest.approx(0.3, rel=0.05)
        # 0.3 m from the joint, where the mass and its own lever make the inertia; in the frame of the tool, 0.35 m out
        com = first.parameters["com"]
        off = np.abs(np.array(com.value) - [-0.05, 0.0, 0.0])
        assert (off < 4.0 * np.array(com.std_error)).all() and (off < 0.04).all()


@pytest.mark.parametrize("seed", range(4))
def test_step_and_drift_are_told_apart(seed: int) -> None:
    rng = np.random.default_rng(seed)
    when = 86400.0 * np.arange(40) / 4
    noise = 0.1 * rng.standard_normal(40)
    step = course(when, noise + (np.arange(40) >= 25))
    assert (step.form, step.began) == ("step", 25)
    assert step.size == pytest.approx(1.0, abs=0.15)
    drift = course(when, noise + 0.25 * np.maximum(when / 86400 - 4.0, 0.0))
    assert drift.form == "drift"
    assert drift.per_day == pytest.approx(0.25, rel=0.2)
    assert course(when[:6], noise[:6]).form == "cannot_tell"
    # programmes whose levels differ by ten times the change
    programme = rng.integers(0, 3, 40)
    mixed = course(when, noise + (np.arange(40) >= 25) + 10.0 * programme, programme)
    assert (mixed.form, mixed.began) == ("step", 25)
    assert mixed.size == pytest.approx(1.0, abs=0.15)
    assert course(when, noise + (np.arange(40) >= 25) + 10.0 * programme).form == "cannot_tell"


def units_of(values: np.ndarray, temperature: np.ndarray, since: np.ndarray) -> Units:
    n = len(values)
    zero, one = np.zeros((n, 1)), np.ones((n, 1))
    return Units(
        (Column("viscous_friction", 1, None, 0),),
        np.arange(n, dtype=float),
        np.full(n, 60.0),
        np.zeros(n, dtype=np.intp),
        np.arange(n),
        values[:, None],
        one,
        100 * one,
        one,
        one,
        zero + temperature[:, None],
        since,
    )


@pytest.mark.parametrize("known", ["temperature", "since_start"])
def test_warm_up_is_learned_and_is_no_wear(known: str) -> None:
    rng = np.random.default_rng(0)
    since = rng.uniform(0, 6000, 60)
    warm = 25 + 20 * (1 - np.exp(-since / 1200.0))
    values = 1 - 0.2 * (warm - 25) / 20 + 0.005 * rng.standard_normal(60)
    nothing = np.full(60, np.nan)
    units = units_of(
        values, warm if known == "temperature" else nothing, since if known == "since_start" else nothing
    )
    listed = [Stream("viscous_friction", 1, None, 0)]
    cleared = adjust(units, values[:, None], listed, healthy=20)
    assert cleared.known == known and cleared.warmth.any()
    assert cleared.values.std() < 0.2 * values.std()
    untold = adjust(units_of(values, nothing, nothing), values[:, None], listed, healthy=20)
    assert untold.known is None
    np.testing.assert_array_equal(untold.values[:, 0], values)


def test_a_long_log_is_several_units_of_about_the_same_length() -> None:
    pieces = unit_edges(np.full(61, 30.0))  # half an hour and a little
    assert [p.stop - p.start for p in pieces] == [15, 16, 15, 15] or len(pieces) == 4
    assert pieces[0].start == 0 and pieces[-1].stop == 61
    assert unit_edges(np.full(20, 30.0)) == [slice(0, 20)]


def test_without_a_filter_blocks_have_the_times_and_temperatures_of_the_log(
    model: ReconstructedModel,
) -> None:
    log = operate(3, 0)
    late = replace(log, time=log.time + 1.7e9, vdot=np.gradient(log.v, log.time, axis=0))
    seconds = float(np.ptp(log.time))
    warmth = np.linspace(20.0, 40.0, log.samples)
    unfiltered = replace(model, conditioning=replace(model.conditioning, cutoff_hz=0.0))
    sums = log_sums(unfiltered, late, {"temperature": warmth})
    assert sums.start[0] == pytest.approx(late.time[0], abs=1.0)
    assert sums.seconds.sum() == pytest.approx(seconds, rel=0.05)
    middles = (sums.start + 0.5 * sums.seconds - late.time[0]) / seconds
    np.testing.assert_allclose(sums.temperature[:, 0], 20.0 + 20.0 * middles, atol=0.5)


def test_columns_lie_in_memory_for_a_few_blocks_at_a_time(
    model: ReconstructedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the pieces, the sums are the same, across a gap and at their edges, where a delay looks back."""
    log = operate(3, 0, None, 160.0)
    log = log.select((log.time < 70.0) | (log.time > 75.0))
    sizes: list[int] = []

    def counted(*given: object) -> object:
        known = summing_catalogue(*given)
        sizes.append(len(known.values))
        return known

    summing_catalogue = summing.catalogue
    monkeypatch.setattr(summing, "catalogue", counted)
    monkeypatch.setattr(summing, "_PIECE", 1 << 30)
    whole = log_sums(model, log)
    (together,) = sizes
    sizes.clear()
    monkeypatch.setattr(summing, "_PIECE", together // 3)
    parts = log_sums(model, log)
    assert len(sizes) > 2 and max(sizes) < 0.45 * together
    assert parts.columns == whole.columns
    for name in ("start", "rows", "energy", "load"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    for name in ("gram", "moment"):
        a, b = getattr(parts, name), getattr(whole, name)
        assert (np.abs(a - b) <= 1e-12 * np.abs(b).max(axis=0)).all(), name
