"""Column inference from values: which columns are clocks or counters, and which is the time derivative of which.

Names of columns may say nothing, or say it in a language that nobody foresaw; a derivative stays one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from armloop.convert.units import FACTORS, RATES
from armloop.convert.vocabulary import wanted
from armloop.util.arrays import Array

# Rows that are looked at: enough of any motion to tell a derivative by.
_ROWS = 20_000
# Periods over which a difference and an integral are compared: what is shorter is mostly the encoder's steps.
_SPAN = 8
# The least correlation of a derivative. Torque of a joint with much viscous friction resembles its velocity as well:
# what tells them apart is that a velocity is its position's rate in some unit there is, to this part.
_LIKE, _NEAR = 0.9, 0.025
_FACTORS = np.array(
    sorted(
        {
            FACTORS["q"][q] / FACTORS["v"][v] / second
            for q in RATES
            for v in FACTORS["v"]
            for second in FACTORS["time"].values()
            if (q in ("m", "mm")) == (v in ("m/s", "mm/s"))
        }
    )
)


@dataclass(frozen=True)
class Evidence:
    """What columns show."""

    clocks: list[str]  # rise throughout, those that do not simply count first
    counters: list[str]  # the clocks among them that rise by one from row to row
    constant: list[str]  # have one value, or none
    # by column, the column that is its derivative, their correlation, and how many times the column's rate per unit of
    # the first clock (per row without one) that derivative is
    rates: dict[str, tuple[str, float, float]]

    @property
    def used(self) -> set[str]:
        """Columns that are neither positions nor torques."""
        return {*self.clocks, *self.constant}


def evidence(
    columns: Mapping[str, Array], clock: str | None = None, starts: Sequence[int] = (0,)
) -> Evidence:
    """What (N,) columns show; ``clock`` is the column of time where that is known, ``starts`` as of a recording."""
    cut = {name: cells[:_ROWS] for name, cells in columns.items()}
    steps = {
        name: np.diff(cells) for name, cells in cut.items() if len(cells) > 2 and np.isfinite(cells).all()
    }
    constant = [name for name, step in steps.items() if not step.any()]
    constant += [name for name in cut if name not in steps]
    inside = np.ones(max(len(next(iter(cut.values()), [])) - 1, 0), dtype=bool)
    inside[[start - 1 for start in starts if 0 < start <= len(inside)]] = False
    rising = [name for name, step in steps.items() if (step[inside] > 0).all()]
    counters = [name for name in rising if (steps[name][inside] == 1).all()]
    clocks = [*(name for name in rising if name not in counters), *counters]
    by = clock if clock is not None and clock in steps else next(iter(clocks), None)
    moving = [name for name in steps if name not in {*rising, *constant, clock}]
    # A reference has the same derivative as what follows it.
    moving = [name for name in moving if not wanted(name)] or moving
    time = cut[by] if by is not None else np.arange(float(len(next(iter(cut.values()), []))))
    return Evidence(clocks, counters, constant, _rates({name: cut[name] for name in moving}, time))


def _rates(columns: dict[str, Array], time: Array) -> dict[str, tuple[str, float, float]]:
    """The derivative of each column that has one, each taken once, the clearest first."""
    if len(columns) < 2 or len(time) < 4 * _SPAN:
        return {}
    names = list(columns)
    x = np.stack(list(columns.values()), axis=1)
    dt = np.diff(time)
    usual = float(np.median(dt))
    if usual <= 0:
        return {}
    # A gap, or a clock that starts anew, is stepped over: it counts as one period, and its difference as none.
    good = (dt > 0) & (dt < 10 * usual)
    area = np.where(good[:, None], 0.5 * (x[1:] + x[:-1]) * dt[:, None], 0.0)
    change = np.where(good[:, None], np.diff(x, axis=0), 0.0)
    integral = _over_span(area - area.mean(axis=0))
    difference = _over_span(change - change.mean(axis=0))
    sizes = np.linalg.norm(difference, axis=0), np.linalg.norm(integral, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        product = difference.T @ integral
        likeness = np.nan_to_num(product / np.outer(*sizes))
        ratio = np.nan_to_num(product / sizes[0][:, None] ** 2)
    np.fill_diagonal(likeness, 0.0)
    is_factor = (np.abs(ratio[..., None] / _FACTORS - 1) < _NEAR).any(axis=-1)
    likeness = np.where(is_factor, likeness, 0.0)
    found: dict[str, tuple[str, float, float]] = {}
    taken: set[int] = set()
    for flat in np.argsort(-likeness, axis=None):
        a, b = (int(k) for k in np.unravel_index(flat, likeness.shape))
        if likeness[a, b] < _LIKE:
            break
        # q -> v -> q cannot be: of two that resemble each other's derivative the clearer one is it.
        if names[a] in found or b in taken or found.get(names[b], ("",))[0] == names[a]:
            continue
        found[names[a]] = (names[b], float(likeness[a, b]), float(ratio[a, b]))
        taken.add(b)
    return found


def _over_span(steps: Array) -> Array:
    """Sums over a moving window of rows."""
    total = np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])
    return np.asarray(total[_SPAN:] - total[:-_SPAN])
