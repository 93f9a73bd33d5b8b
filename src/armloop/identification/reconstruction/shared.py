"""Common parts of the libraries that serve all joints with shared coefficients.

Which samples they regress, what the motion must show for that, and the friction that stands in until each joint's
own is chosen.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from armloop.data.creep import held_speed, may_stick
from armloop.data.filters import at_least
from armloop.data.motion import Motion, Samples
from armloop.data.signals import Conditioning
from armloop.features.rigid_body import BaseParameters
from armloop.laws.friction import FrictionTerm
from armloop.regression.determined import combination, identifiable
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Mask
from armloop.util.errors import ExcitationError

#: Friction with memory needs every sample.
SHARED_CONDITIONING = Conditioning(cutoff_hz=8.5)

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
PLAIN_FRICTION = tuple(term for term in FRICTION if term.kind != "hysteresis")
#: A joint that may stick creeps steadily where its smallest speed, over a period of the filter to both sides, is so much of
#: the largest.
_STEADY = 0.5
#: Part of the samples that a model knows the arm's range by leaves out at each end.
_TAIL = 0.005
#: What a constraint has pressed to zero, N·m.
_NOTHING = 1e-12


def sliding_rows(samples: Samples) -> Mask:
    """(N, n) samples in which a joint's torque is determined by its motion: it is fast, or it creeps steadily."""
    return fast_rows(samples) | (samples.moving & _steady(samples))


def fast_rows(samples: Samples) -> Mask:
    """(N, n) samples so fast that a direction which fades in late (:data:`FRICTION`) is right all the same."""
    return samples.moving & (np.abs(samples.motion.v) > sticking(samples))


def sticking(samples: Samples) -> Array:
    """(n,) speeds below which a joint's torque is not determined by its motion, unless it creeps steadily; rad/s (m/s)."""
    fastest = samples.fastest
    return may_stick(np.full(samples.motion.joints, np.inf) if fastest is None else fastest)


def _steady(samples: Samples) -> Mask:
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


def motion_range(motion: Motion) -> list[list[float]]:
    """Half ranges of q, v, vdot, then the centre of q: where a model knows the arm."""
    low, high = np.quantile(motion.q, _TAIL, axis=0), np.quantile(motion.q, 1 - _TAIL, axis=0)
    rates = [np.quantile(np.abs(x), 1 - _TAIL, axis=0).tolist() for x in (motion.v, motion.vdot)]
    return [(0.5 * (high - low)).tolist(), *rates, (0.5 * (high + low)).tolist()]


def slowest_sliding(samples: Samples) -> list[float]:
    """(n,) slowest held speed, rad/s (m/s), at which each joint's friction is known: of what is fitted, 0.5 % is slower.

    Zero where a joint never slides.
    """
    rows = sliding_rows(samples)
    speeds = (v[mine] for v, mine in zip(held_speed(samples).T, rows.T, strict=True))
    return [float(np.quantile(v, _TAIL)) if len(v) else 0.0 for v in speeds]


def check_moves(arm: Arm, counts: Array) -> None:
    """Raise unless every joint moves in enough samples that are fitted; ``counts`` (n,) of them."""
    for j, joint in enumerate(arm.joints):
        if counts[j] < 100:
            raise ExcitationError(
                f"q{j + 1}: joint {joint.name!r} moves in {int(counts[j])} samples, at least 100 are needed; "
                f"log runs in which every joint moves, or lock one that never does: --lock {joint.name}=VALUE"
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


def check_rank(G: Array, base: BaseParameters) -> None:
    """Raise unless the motion tells most base parameters apart; the ridge takes care of the last few.

    Args:
        G: (r, r) products of the base parameters' columns.
    """
    kept, _ = identifiable(G)
    weak = base.count - len(kept)
    if weak > base.count // 3:
        raise ExcitationError(
            f"the motion leaves {weak} of {base.count} inertial parameters undetermined; log exciting motion of all "
            "joints"
        )


def undetermined_notes(G: Array, base: BaseParameters) -> list[str]:
    """Which base parameters a motion does not determine by themselves, and the sums that it does, in a line.

    Args:
        G: (r, r) products of the base parameters' columns.
    """
    kept, sums = identifiable(G)
    if len(kept) == base.count:
        return []
    leads = [name.split(" ")[0] for name in base.names]
    lost = [leads[k] for k in range(base.count) if k not in kept]
    known = [
        combination(row, leads, int(k))
        for k, row in zip(kept, sums, strict=True)
        if np.count_nonzero(row) > 1
    ]
    line = (
        f"the motion does not determine {len(lost)} of {base.count} inertial parameters by themselves: {', '.join(lost)} "
        "were taken from the URDF"
    )
    return [line + (f"; what it determines is {', '.join(known)}" if known else "")]
