"""A motor that two joints share may turn with either by any ratio, which an arm was built with; even ones come first."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.motion import Motion
from armloop.identification.reconstruction import Options, catalogue, reconstruct

Array = NDArray[np.float64]


@pytest.mark.parametrize("ratio", [5.2, pytest.param(-0.3, marks=pytest.mark.long)])
def test_a_motor_of_one_joint_that_the_other_turns_a_little_has_that_ratio(ratio: float) -> None:
    """As in the wrist of a Puma, whose last motor turns with v6 + 0.18 v5."""
    parts = {"inertia": 0.05, "viscous": 0.3, "coulomb": 0.5}
    size = max(1.0, abs(ratio))

    def geared(motion: Motion) -> Array:
        w, rate = (x[:, 1] / size + ratio / size * x[:, 2] for x in (motion.v, motion.vdot))
        torque = parts["inertia"] * rate + parts["viscous"] * w + parts["coulomb"] * np.sign(w)
        return np.outer(torque, [0, 1 / size, ratio / size])

    motion = fourier_motion(40, 100, 0)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v) + geared(motion)
    options = Options(standard_errors=False, parts=False)
    log = measured(motion, tau, 0, name="run")
    (added,) = reconstruct([log], three_axis(), library="rigid-body", options=options).model.effects
    assert added.effect.place == ("transmission_coupling", 2, 3)
    assert added.parameters["ratio"].value == pytest.approx(ratio, rel=0.04)
    assert np.isnan(added.parameters["ratio"].std_error)
    # per unit of w = v2 + r v3; of the ratio's error each has its part
    for key, power in (("inertia", 2), ("viscous", 2), ("coulomb", 1)):
        assert added.parameters[key].value == pytest.approx(parts[key] / size**power, rel=0.1), key


@pytest.mark.parametrize(
    ("removed", "best"),
    [
        ({1.0: 8.0, 3.0: 10.0, 2.0: 9.5}, 3.0),
        (
            {1.0: 8.0, 3.0: 8.8, 2.0: 8.8},
            1.0,
        ),  # nine tenths of it are as good: an arm's gears are mostly even
        ({1.0: 8.0, -4.0: 20.0, 2.0: 10.0}, 2.0),  # what removes more is no motor
        ({1.0: 8.0, 3.0: 10.0, 3.1: 11.0}, 3.1),
    ],
)
def test_a_ratio_of_gears_is_even_unless_another_removes_clearly_more(
    removed: dict[float, float], best: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(catalogue, "_smoothed", lambda samples, columns: columns)
    monkeypatch.setattr(catalogue, "_plausible", lambda arm, effect, shape, found: shape > 0)
    law: Any = SimpleNamespace(
        fixed_columns=lambda context, shape: shape,
        geared=lambda shape: [x for x in removed if x != 1.0] if shape == 1.0 else [shape, 3.1],
    )
    own: Any = SimpleNamespace(
        trial=lambda shape, new, worth: SimpleNamespace(removed=removed[shape]) if shape in removed else None
    )
    context: Any = SimpleNamespace(arm=None)
    nothing: Any = None
    first: Any = SimpleNamespace(removed=removed[1.0])
    shape, trial = catalogue._geared(own, law, 1.0, first, context, nothing)
    assert shape == best and trial.removed == removed[best]
