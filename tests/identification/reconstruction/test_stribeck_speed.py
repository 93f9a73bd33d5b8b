"""Each joint's Stribeck velocity is found, and its friction then reads as the law that it is."""

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.reconstruction.friction_selection import extensions
from armloop.identification.reconstruction.stribeck_speed import _vertex, gains
from armloop.regression.moments import Moments

#: Between those of the row of velocities, and each joint's own.
SPEEDS = np.array([0.1, 0.045, 0.2])
LEVEL, EXCESS, VISCOUS = 0.5, 0.25, 1.0


def a_run(seed: int, by_load: float = 0.0, speeds: np.ndarray = SPEEDS) -> MotionLog:
    motion = fourier_motion(40.0, 200.0, seed)
    v = motion.v
    load = rigid_torque(three_axis(), motion.q, v, motion.vdot)
    dry = (LEVEL + by_load * np.abs(load) + EXCESS * np.exp(-((v / speeds) ** 2))) * np.tanh(v / 1e-3)
    return measured(motion, load + dry + VISCOUS * v, seed, noise=0.005)


def test_friction_reads_as_the_law_that_it_is() -> None:
    options = Options(standard_errors=False, parts=False)
    result = reconstruct(
        [a_run(seed) for seed in (1, 2, 3)], three_axis(), library="rigid-body", options=options
    )
    assert max(result.held_out.moving["nrmse"]) < 0.01
    for terms, speed in zip(result.model.friction.terms, SPEEDS, strict=True):
        (viscous,) = (t.coefficient for t in terms if t.kind == "viscous")
        peaks = [t for t in terms if t.kind == "stribeck_peak"]
        main = max(peaks, key=lambda term: term.coefficient)
        level = sum(t.coefficient for t in terms if t.kind == "smooth_sign")
        assert viscous == pytest.approx(VISCOUS, rel=0.02)
        assert level == pytest.approx(LEVEL, rel=0.03)
        assert main.parameter == pytest.approx(speed, rel=0.1)
        assert not {t.kind for t in terms} - {"smooth_sign", "viscous", "stribeck_peak"}


def test_a_fall_is_read_beside_friction_that_grows_with_the_load() -> None:
    """Beside Coulomb and viscous friction alone, the velocity of the first joint's stands for the load, too: 0.118."""
    logs = [a_run(seed, 0.3, np.array([0.1, 0.06, 0.15])) for seed in (1, 2, 3)]
    options = Options(standard_errors=False, parts=False)
    result = reconstruct(logs, three_axis(), library="rigid-body", options=options)
    assert any("Stribeck, once more: joints 1" in note for note in result.notes)
    terms = {term.kind: term for term in result.model.friction.terms[0]}
    assert len(result.model.friction.terms[0]) == len(terms) == 4
    assert terms["stribeck_peak"].parameter == pytest.approx(0.1, rel=0.03)
    assert terms["stribeck_peak"].coefficient == pytest.approx(EXCESS, rel=0.03)
    assert terms["smooth_sign"].coefficient == pytest.approx(LEVEL, rel=0.03)
    assert terms["viscous"].coefficient == pytest.approx(VISCOUS, rel=0.01)
    assert terms["load_smooth_sign"].coefficient == pytest.approx(0.3, rel=0.03)


def test_one_velocity_comes_before_the_row_and_takes_a_place_of_it() -> None:
    motion = fourier_motion(5.0, 100.0, 1)
    row = extensions(three_axis(), motion)
    both = extensions(three_axis(), motion, None, [0.1, 0.02, 0.2])
    assert [rung.name for rung in both][2:5] == [
        "Stribeck",
        "Coulomb fading in",
        "Stribeck at several velocities",
    ]
    assert [[t.parameter for t in own] for own in both[2].elements] == [[0.1], [0.02], [0.2]]
    for own, rest, speed in zip(row[2].elements, both[4].elements, (0.1, 0.02, 0.2), strict=True):
        left = {t.parameter for t in own} - {t.parameter for t in rest}
        nearest = min((t.parameter for t in own), key=lambda x: abs(np.log(x / speed)))
        assert left == {nearest}
    assert both[:2] + both[3:4] + both[5:] == row[:2] + row[3:]


def test_what_a_column_removes_is_what_it_removes_beside_the_others() -> None:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 6)) @ rng.normal(size=(6, 6))
    X[:, 2] = X[:, 0] - 3.0 * X[:, 1]  # what others span already counts for nothing
    y = X[:, 3] + 2.0 * X[:, 4] - X[:, 5] + rng.normal(size=300)

    def left(columns: list[int]) -> float:
        A = X[:, columns]
        return float(np.sum((y - A @ np.linalg.lstsq(A, y)[0]) ** 2))

    found = gains(Moments.of(X, y), 3)
    before = left([0, 1])
    for k in range(3):
        slope = np.linalg.lstsq(X[:, [0, 1, 3 + k]], y)[0][-1]
        expected = before - left([0, 1, 3 + k]) if slope > 0 else 0.0
        assert found[k] == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert gains(Moments.of(X[:, :3], y), 1) == [0.0]


@pytest.mark.parametrize(
    ("height", "expected"),
    [([0.0, 3.0, 4.0, 3.0], 2.0), ([0, 0.75, 1, 0.25], 1.75), ([3, 2, 1, 0], 0.0), ([0, 0, 0, 0], 0.0)],
)
def test_the_best_lies_between_the_points_of_a_grid(height: list[float], expected: float) -> None:
    assert _vertex(np.arange(4.0), np.array(height, dtype=float)) == pytest.approx(expected)
