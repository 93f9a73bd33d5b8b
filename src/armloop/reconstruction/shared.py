"""What the libraries that serve all joints with shared coefficients have in common.

Which samples they regress, what the motion must show for that, and the friction that stands in until each joint's
own is chosen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from armloop.arm import Arm
from armloop.errors import ExcitationError
from armloop.library.friction import FrictionTerm
from armloop.library.rigid_body import BaseParameters
from armloop.motion import Samples
from armloop.signals import Conditioning, at_least

Array = NDArray[np.float64]

#: Friction with memory needs every sample.
SHARED_CONDITIONING = Conditioning(cutoff_hz=9.5)

#: Presliding widths, rad, and the speed below which the direction fades in, rad/s. Held-out errors on
#: measured arms are flat around these values.
FRICTION = (
    FrictionTerm("offset"),
    FrictionTerm("smooth_sign", parameter=0.01),
    FrictionTerm("hysteresis", parameter=1e-3),
    FrictionTerm("hysteresis", parameter=1e-2),
    FrictionTerm("viscous"),
    FrictionTerm("quadratic"),
)
#: What the load is estimated with, before any friction that depends on it is regressed.
PLAIN_FRICTION = FRICTION[:2] + FRICTION[4:]
#: Below this speed, rad/s or m/s, a joint's torque is not determined by its motion, unless it creeps steadily: so much
#: of the largest speed must the smallest one be, over a period of the filter to both sides.
_SLIDING, _STEADY = 0.01, 0.5
#: What a constraint has pressed to zero, N·m.
_NOTHING = 1e-12


def sliding_rows(samples: Samples) -> NDArray[np.bool_]:
    """(N, n) samples in which a joint's torque is determined by its motion: it is fast, or it creeps steadily."""
    return fast_rows(samples) | (samples.moving & _steady(samples))


def fast_rows(samples: Samples) -> NDArray[np.bool_]:
    """(N, n) samples so fast that a direction which fades in late (:data:`FRICTION`) is right all the same."""
    return samples.moving & (np.abs(samples.motion.v) > _SLIDING)


def _steady(samples: Samples) -> NDArray[np.bool_]:
    """(N, n) samples around which a joint keeps its direction and about its speed."""
    v = samples.motion.v
    steady = np.zeros(v.shape, dtype=bool)
    if samples.cutoff_hz <= 0:
        return steady
    width = 2 * at_least(1 / (samples.cutoff_hz * samples.period)) + 1
    for run in samples.motion.runs():
        low = minimum_filter1d(v[run], width, axis=0, mode="nearest")
        high = maximum_filter1d(v[run], width, axis=0, mode="nearest")
        least, most = np.minimum(np.abs(low), np.abs(high)), np.maximum(np.abs(low), np.abs(high))
        steady[run] = (low * high > 0) & (least >= _STEADY * most)
    return steady


def check_moves(arm: Arm, rows: NDArray[np.bool_]) -> None:
    """Raise unless every joint moves in the rows (N, n) that are fitted."""
    for j, joint in enumerate(arm.joints):
        if rows[:, j].sum() < 100:
            raise ExcitationError(
                f"q{j + 1}: joint {joint.name!r} moves in {int(rows[:, j].sum())} samples, at least 100 are needed; "
                "log runs in which every joint moves"
            )


def found_friction(laws: list[list[FrictionTerm]], values: Array) -> list[list[FrictionTerm]]:
    """The laws with their coefficients, joint after joint; terms that vanished are left out."""
    friction, start = [], 0
    for law in laws:
        own = values[start : start + len(law)]
        friction.append(
            [
                FrictionTerm(t.kind, float(c), t.parameter)
                for t, c in zip(law, own, strict=True)
                if abs(c) > _NOTHING
            ]
        )
        start += len(law)
    return friction


def check_rank(columns: Array, rows: NDArray[np.bool_], base: BaseParameters) -> None:
    """Raise unless the motion tells most base parameters apart; the ridge takes care of the last few."""
    stacked = np.concatenate([columns[rows[:, j], j] for j in range(columns.shape[1])])
    scale = np.linalg.norm(stacked, axis=0)
    scaled = stacked / np.maximum(scale, 1e-12)
    eigenvalues = np.linalg.eigvalsh(scaled.T @ scaled)
    weak = int(np.count_nonzero(eigenvalues < 1e-8 * eigenvalues[-1]))
    if weak > base.count // 3:
        raise ExcitationError(
            f"the motion leaves {weak} of {base.count} inertial parameters undetermined; log exciting motion of all "
            "joints"
        )
