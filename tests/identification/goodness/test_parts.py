"""The parts of a torque's energy: noise is called noise, a missing law is found, memory does not pass for a law."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from synthetic import fourier_motion

from armloop.data.motion import Samples
from armloop.identification.goodness import Parts, parts_of, witness
from armloop.identification.goodness import parts as parts_module
from armloop.identification.goodness.split import FOLDS, Split, correlation_time, split
from armloop.identification.reconstruction import Reconstruction

Array = NDArray[np.float64]
PERIOD, CUTOFF = 0.02, 10.0
#: Chance is met twice, and more often where there is time.
SEEDS = [0, 1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3))]


def samples(seconds: float = 60.0, seed: int = 0) -> Samples:
    """A motion of three joints, with a torque of unit RMS that only sets the scale."""
    motion = fourier_motion(seconds, 1 / PERIOD, seed)
    return Samples(motion, np.ones_like(motion.q), np.ones_like(motion.q, dtype=bool), PERIOD, CUTOFF)


def white(given: Samples, seed: int, size: float = 1.0) -> Array:
    return size * np.random.default_rng(seed).normal(size=given.tau.shape)


def remembering(given: Samples, seed: int, seconds: float) -> Array:
    """Noise of unit variance that remembers itself for so long, whatever the arm does."""
    keep = np.exp(-PERIOD / seconds)
    noise = lfilter([1.0], [1.0, -keep], white(given, seed), axis=0)
    return noise / noise.std(axis=0)


def parts(residual: Array, given: Samples, judged: NDArray[np.bool_] | None = None) -> list[Parts]:
    return parts_of(witness(residual, given, judged=judged))


def check_sums(found: list[Parts]) -> None:
    for one in found:
        assert one.explained is not None and one.predictable_left is not None and one.noise is not None
        assert one.explained + one.predictable_left + one.noise == pytest.approx(1.0, abs=1e-12)
        assert min(one.explained, one.predictable_left, one.noise) >= 0


@pytest.mark.parametrize("seed", SEEDS)
def test_white_noise_is_noise(seed: int) -> None:
    given = samples(seed=seed)
    found = parts(white(given, seed), given)
    check_sums(found)
    for one in found:
        # of M independent rows, one weight per regression and fold is worth some M-th parts
        assert one.predictable_left < 0.01
        assert not one.much_is_left


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("seconds", [0.2, 1.0])
def test_noise_that_remembers_itself_is_noise(seed: int, seconds: float) -> None:
    given = samples(120.0, seed)
    for one in parts(remembering(given, seed, seconds), given):
        assert one.predictable_left < 0.1  # some 120 / 2 s independent stretches decide
        assert not one.much_is_left


def test_without_a_gap_memory_would_pass_for_a_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test above can fail: folds whose blocks touch what is fitted find laws in noise alone."""
    given = samples(60.0, 1)
    noise = remembering(given, 1, 1.0)

    def leaking(place: Array, run: NDArray[np.intp], gap: float) -> Split:
        return Split(np.arange(len(place)) % FOLDS, np.arange(len(place)), place, 0.0, True)

    monkeypatch.setattr(parts_module, "split", leaking)
    assert min(one.predictable_left for one in parts(noise, given)) > 0.2


def missing(given: Samples) -> dict[str, Array]:
    """Laws of unit RMS on joint 2 that depend on the state, on another joint, on the path."""
    q, v = given.motion.q, given.motion.v
    state, path = 0.0, []
    for step in np.diff(q[:, 1], prepend=q[0, 1]):
        state = float(np.clip(state + step, -0.2, 0.2))
        path.append(state)
    laws = {
        "spring": q[:, 1] - 0.3,
        "dry friction": np.sign(v[:, 1]),
        "coupling": np.sign(v[:, 1] + v[:, 2]),
        "product": np.cos(2 * q[:, 0]) * v[:, 1],
        "path": np.array(path),
    }
    return {name: law / np.sqrt(np.mean(law**2)) for name, law in laws.items()}


@pytest.mark.parametrize("law", ["spring", "dry friction", "coupling", "product", "path"])
def test_a_missing_law_is_predictable(law: str) -> None:
    given = samples()
    noise = white(given, 3)
    residual = 0.1 * noise
    residual[:, 1] += 0.3 * missing(given)[law]
    found = parts(residual, given)
    check_sums(found)
    one = found[1]
    assert one.predictable_left == pytest.approx(0.09, rel=0.25)
    assert one.noise == pytest.approx(0.01, abs=0.02)
    assert one.much_is_left and "joint 2" in one.sentence()
    assert not found[0].much_is_left and not found[2].much_is_left


@pytest.mark.parametrize("order", [6, 20])
def test_a_missing_ripple_is_predictable(order: int) -> None:
    """One and a half and five periods in the travel of joint 2, of which sin q and cos q say nothing."""
    given = samples()
    residual = 0.1 * white(given, 3)
    residual[:, 1] += 0.3 * np.sqrt(2) * np.sin(order * given.motion.q[:, 1] + 0.5)
    found = parts(residual, given)
    check_sums(found)
    assert found[1].predictable_left == pytest.approx(0.09, rel=0.15)
    assert not found[0].much_is_left and not found[2].much_is_left


def test_friction_that_depends_on_the_place_is_predictable() -> None:
    """A tight spot of joint 2, a quarter of its travel wide, beside dry friction that was taken for it."""
    given = samples(20.0)
    q, v = given.motion.q[:, 1], given.motion.v[:, 1]
    spot = np.exp(-(((q - q.mean()) / (0.12 * np.ptp(q))) ** 2))
    law = (spot - spot.mean()) * np.sign(v)
    residual = 0.1 * white(given, 3)
    residual[:, 1] += 0.3 * law / np.sqrt(np.mean(law**2))
    found = parts(residual, given)
    check_sums(found)
    assert found[1].predictable_left == pytest.approx(0.09, rel=0.2)
    assert not found[0].much_is_left and not found[2].much_is_left


def test_what_was_fitted_helps_and_does_not_judge() -> None:
    """A residual that is small where the model was fitted says nothing there."""
    given = samples()
    residual = 0.3 * missing(given)["dry friction"][:, None] + white(given, 0, 0.05)
    judged = (given.motion.time // 1.0) % 5 == 0
    fitted = np.where(judged[:, None], residual, 0.0)
    assert parts(fitted, given, judged)[0].explained == pytest.approx(
        parts(residual, given)[0].explained, abs=0.02
    )
    assert parts(fitted, given)[0].explained > 0.97


def test_a_model_worse_than_none_explains_nothing() -> None:
    given = samples()
    found = parts(3.0 * white(given, 0), given)
    check_sums(found)
    assert all(one.explained == 0.0 for one in found)


def test_a_joint_at_rest_has_no_parts() -> None:
    given = samples()
    moving = given.moving.copy()
    moving[:, 0] = False
    found = parts(white(given, 0), replace(given, moving=moving))
    assert found[0].explained is None and not found[0].much_is_left
    assert found[1].explained is not None


def test_it_is_deterministic() -> None:
    given = samples()
    residual = white(given, 0) + missing(given)["path"][:, None]
    assert parts(residual, given) == parts(residual, given)


def test_witnesses_of_several_logs_add() -> None:
    """Two logs, one after the other or added up, are the same rows; runs never touch."""
    given = samples()
    residual = white(given, 0) + missing(given)["spring"][:, None]
    once = witness(residual, given)
    both = once + once
    assert len(both.joints[0].residual) == 2 * len(once.joints[0].residual)
    assert np.diff(both.joints[0].place).min() > 0
    assert len(np.unique(both.joints[0].run)) == 2


def test_fitted_samples_keep_the_gap() -> None:
    rng = np.random.default_rng(0)
    place = np.sort(rng.uniform(0, 100, 3000))
    run = (place > 40).astype(np.intp)
    cut = split(place, run, 0.7)
    assert cut.enough
    for fold in range(FOLDS):
        judged, fitted = place[cut.fold == fold], place[cut.fitted(fold)]
        assert np.abs(judged[:, None] - fitted[None, :]).min() >= 0.7
        assert len(fitted) > 0.3 * len(place)


def test_data_too_short_for_the_gap_say_so() -> None:
    place = np.arange(0, 20, 0.02)
    assert not split(place, np.zeros(len(place), dtype=np.intp), 5.0).enough


@pytest.mark.parametrize("seconds", [0.1, 0.5])
def test_correlation_time(seconds: float) -> None:
    """An autocorrelation of exp(−t/T) falls below 0.2 after 1.6 T."""
    given = samples(600.0)
    noise = remembering(given, 2, seconds)[:, 0]
    place = given.motion.time
    keep = np.random.default_rng(0).random(len(place)) > 0.2  # samples at rest are missing
    found = correlation_time(noise[keep], place[keep], 10.0)
    assert found == pytest.approx(-np.log(0.2) * seconds, rel=0.25)


def test_a_torque_that_nothing_explains_is_said() -> None:
    noise = Parts(2, 0.05, 0.0, 0.95, 0.01, 0.1)
    assert noise.little_is_explained and noise.little().startswith("joint 2: the model explains 5.0%")
    assert not replace(noise, explained=0.11).little_is_explained
    assert not replace(noise, explained=None).little_is_explained
    # what is predictable is a law that is missing, and said as such
    assert not replace(noise, predictable_left=0.5).little_is_explained
    held_out = SimpleNamespace(moving={"nrmse": [0.1, 0.9, None]})
    faults: list[str] = []
    model = SimpleNamespace(history={"physics": {"faults": faults}})
    made = SimpleNamespace(parts=[noise, replace(noise, explained=0.9)], held_out=held_out, model=model)
    assert Reconstruction.warnings.fget(made) == [noise.little()]  # type: ignore[attr-defined]
    faults += ["friction drives joint 1", "M(q) is asymmetric"]
    first, *_ = Reconstruction.warnings.fget(made)  # type: ignore[attr-defined]
    assert first == "no arm has this model, whatever it leaves: friction drives joint 1; M(q) is asymmetric"
