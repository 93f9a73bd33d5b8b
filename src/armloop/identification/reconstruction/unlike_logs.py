"""Homogeneity of the training logs: whether one arm made them all, or one of them with another tool, load, zero or gain.

What base parameters of all logs leave of each, beside friction of its own, is compared with what a plain model of that log
alone leaves on blocks that it was not fitted to (Chow, "Tests of equality between sets of coefficients in two linear
regressions", Econometrica 28, 1960, with blocks left out in place of degrees of freedom: what a model leaves is no noise).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from armloop.data.log import MotionLog
from armloop.identification.reconstruction.bandwidth import determined_solution
from armloop.identification.reconstruction.plain_fits import PlainFits
from armloop.robot.arm import Arm
from armloop.util.arrays import Array, Index

#: Links that fit all leave so many times what each log's own leave (geometric mean of the joints). Logs of one arm, measured
#: and simulated, came to 1.3 at the most; one with a load, or a tool, beside others without, to 5 and 9.
_UNLIKE = 2.0
#: A joint counts in a log that asks this part of the torque of it that all logs do: of a drive that is off, nothing is left.
_DRIVEN = 0.3
#: Least part of a joint's torque that is left: what is less is exact to round-off.
_EXACT = 1e-3


def unlike(whole: PlainFits, logs: Mapping[str, Sequence[MotionLog]], arm: Arm, cutoff_hz: float) -> str:
    """What logs that are not of one arm say, empty where they are, or where there are no two.

    Args:
        whole: the plain model of all of them.
        logs: runs by the name of their log.
    """
    each = {name: PlainFits.of(runs, arm, cutoff_hz) for name, runs in logs.items()} if len(logs) > 1 else {}
    told = {name: own for name, own in each.items() if own is not None}
    if len(told) < 2:
        return ""
    theta = _links_of_all(list(told.values()), whole)
    usual = whole.table.sizes(whole.table.tau, whole.table.moving)
    found = {name: _left(own, theta, usual) for name, own in told.items()}
    ratios = {
        name: float(np.exp(np.mean(np.log(both / own)))) for name, (_, own, both) in found.items() if len(own)
    }
    odd = max(ratios, key=ratios.__getitem__, default="")
    if not ratios or ratios[odd] <= _UNLIKE:
        return ""
    joints, own, both = found[odd]
    k = int(np.argmax(both / own))
    return (
        f"the arm was not the same in all logs: links that fit all leave {both[k]:.0%} of the torque of joint "
        f"{joints[k] + 1} in {odd}, links of that log alone {own[k]:.1%} on blocks left out; as where one carries a tool or "
        "a load that others do not, or has other zeros, gains or units: reconstruct from logs of one state, and diagnose "
        "the others by that model"
    )


def _links_of_all(logs: Sequence[PlainFits], whole: PlainFits) -> Array:
    """(r,) base parameters of all logs beside each log's own friction, which is projected out (Frisch, Waugh and Lovell)."""
    _, size = whole.solved(whole.table.tau, whole.table.moving)
    r, X, y = whole.base.count, [], []
    for own in logs:
        columns, torque, _ = own.table.weighed(own.table.tau, own.table.moving, size)
        rubs = columns[:, r:]
        beside = np.column_stack([columns[:, :r], torque])
        rest = beside - rubs @ determined_solution(rubs, beside)
        X.append(rest[:, :r])
        y.append(rest[:, r])
    return determined_solution(np.concatenate(X), np.concatenate(y))


def _left(own: PlainFits, theta: Array, usual: Array) -> tuple[Index, Array, Array]:
    """Joints (k,) of a log that are driven, and relative errors (k,) by models of its own and by all logs' base parameters.

    Each half of its blocks is judged by a model of the other. Beside the base parameters (r,) of all a log keeps its own
    friction: plain friction is another at other speeds.
    """
    table, squares, r = own.table, [], own.base.count
    scale = table.sizes(table.tau, table.moving)
    for k in (0, 1):
        half = (table.blocks % 2 == k)[:, None]
        fitted, _ = own.solved(table.tau, table.moving & ~half)
        squares.append(table.sizes(table.tau - table.columns @ fitted, table.moving & half) ** 2)
    left = table.tau - table.columns[:, :, :r] @ theta
    rubs = replace(own, table=replace(table, columns=table.columns[:, :, r:]))
    friction, _ = rubs.solved(left, table.moving)
    together = table.sizes(left - rubs.table.columns @ friction, table.moving)
    joints = np.flatnonzero(scale > _DRIVEN * usual)
    alone, both = (
        np.maximum(x[joints] / scale[joints], _EXACT) for x in (np.sqrt(np.mean(squares, axis=0)), together)
    )
    return joints, alone, both
