"""A figure's panels one below the other, for a page as narrow as a phone's."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from armloop.reports.plots.style import MUTED, legend_above

# All lengths in inches.
_WIDTH, _RIGHT = 4.0, 0.16
#: Height of a panel of a grid, at least and at most.
_LOWEST, _HIGHEST = 1.1, 2.3
_TITLE, _TICKS, _GAP = 0.3, 0.26, 0.12
_INCHES_PER_LETTER, _INCHES_PER_LINE = 0.078, 0.17
#: Names before a panel that are longer than this leave it too little of a narrow page.
_LONGEST_NAMES = 1.2
#: Height of a row whose name stands above it.
_ROW = 0.58
#: Values above bars that are closer than this stand upright.
_BAR_PITCH = 0.36


@dataclass(frozen=True)
class _Panel:
    """One panel and what it needs above and below itself."""

    axes: Axes
    height: float
    above: float
    below: float


def stack(made: Figure) -> bool:
    """Rearrange a figure made with :func:`~armloop.reports.plots.style.panels` in place; True where that was possible.

    Names before a panel that would take most of such a page stand above their rows, if it is the only one, and leave
    the figure as it is otherwise. Panels of a grid whose columns are joints (only the first row has titles) are stacked
    column by column, others row by row. What a panel shared with its neighbours, labels and ticks, it then has itself.
    """
    width, height = made.get_size_inches()
    specs = [axes.get_subplotspec() for axes in made.axes]
    if width <= _WIDTH + 0.3 or not specs or any(spec is None for spec in specs):
        return False
    left, bottom = made.subplotpars.left * width, made.subplotpars.bottom * height
    if left > _LONGEST_NAMES:
        return len(specs) == 1 and _names_above(made)
    rows, columns = specs[0].get_geometry()[:2]  # type: ignore[union-attr]
    grid = np.array(made.axes, dtype=object).reshape(rows, columns)
    by_column = columns > 1 and not any(axes.get_title(loc="left") for axes in grid[1:].ravel())
    _say_shared(grid, by_column)
    shown = [axes for axes in (grid.T if by_column else grid).ravel() if axes.get_visible()]
    one = columns == 1
    panels = [_panel(axes, height, one, _WIDTH - left - _RIGHT, bottom) for axes in shown]
    top = legend_above(made, _WIDTH)
    total = top + sum(panel.above + panel.height + panel.below for panel in panels)
    made.set_size_inches(_WIDTH, total)
    at = total - top
    for panel in panels:
        at -= panel.above + panel.height
        panel.axes.set_position(
            (left / _WIDTH, at / total, 1 - (left + _RIGHT) / _WIDTH, panel.height / total)
        )
        at -= panel.below
    return True


def _names_above(made: Figure) -> bool:
    """Write a panel's names, and what stands beside its rows, above the rows of a figure laid out anew; True."""
    (axes,) = made.axes
    top = legend_above(made, _WIDTH)
    names = dict(zip(axes.get_yticks(), axes.get_yticklabels(), strict=True))
    beside = {float(note.xy[1]): note for note in axes.texts if isinstance(note, Annotation)}
    letters = int((_WIDTH - 2 * _RIGHT) / _INCHES_PER_LETTER)
    lines, low = 1, float(max(names, default=0.0)) + 0.5
    for tick, label in names.items():
        note = beside.get(float(tick))
        words = textwrap.wrap(f"{label.get_text()}: {note.get_text()}" if note else label.get_text(), letters)
        lines = max(lines, len(words))
        axes.text(
            0.0,
            tick - 0.36,
            "\n".join(words),
            transform=axes.get_yaxis_transform(),
            color=note.get_color() if note else label.get_color(),
            fontweight=note.get_fontweight() if note else "normal",
            fontsize=9.5,
            va="bottom",
        )
    for note in beside.values():
        note.remove()
    row = _ROW + _INCHES_PER_LINE * (lines - 1)
    highest = -0.4 - _INCHES_PER_LINE * lines / row
    axes.set_yticks([])
    axes.set_ylim(low, highest)
    label = textwrap.wrap(axes.get_xlabel(), letters)
    axes.set_xlabel("\n".join(label))
    height, below = row * (low - highest), 0.4 + _INCHES_PER_LINE * len(label)
    total = top + height + below
    made.set_size_inches(_WIDTH, total)
    axes.set_position((_RIGHT / _WIDTH, below / total, 1 - 2 * _RIGHT / _WIDTH, height / total))
    return True


def _say_shared(grid: np.ndarray[tuple[int, int], np.dtype[np.object_]], by_column: bool) -> None:
    """Write the labels that a panel leaves to the first of its row, the last of its column or the head of it."""
    rows, columns = grid.shape
    if columns == 1:
        return
    for (r, c), axes in np.ndenumerate(grid):
        if (
            c
            and not by_column
            and not axes.get_title(loc="left")
            and (head := grid[0, c].get_title(loc="left"))
        ):
            axes.set_title(head, color=MUTED, fontsize=9.5, loc="left")
        # a title with a unit says what is drawn upwards
        if not axes.get_ylabel() and "[" not in axes.get_title(loc="left"):
            axes.set_ylabel(grid[r, 0].get_ylabel(), color=MUTED, fontsize=9.5)
        axes.tick_params(labelleft=True)
        if not by_column or r == rows - 1:
            if not axes.get_xlabel():
                axes.set_xlabel(grid[-1, c].get_xlabel(), color=MUTED, fontsize=9.5)
            axes.tick_params(labelbottom=True)


def _panel(axes: Axes, height: float, one: bool, wide: float, bottom: float) -> _Panel:
    """Height and margins of a panel ``wide`` inches wide; labels that would not fit are broken or turned."""
    own = axes.get_position().height * height
    if not one:
        own = min(max(own, _LOWEST), _HIGHEST)
    label = axes.get_xlabel()
    broken = textwrap.wrap(label, int(_WIDTH / _INCHES_PER_LETTER))
    if len(broken) > 1 or len(label) * _INCHES_PER_LETTER > 1.4 * wide:
        axes.set_xlabel("\n".join(broken), ha="right", x=1.0)
    ticked = any(text.get_visible() and text.get_text() for text in axes.get_xticklabels())
    below = bottom if label else _TICKS if ticked else 0.0
    below += _INCHES_PER_LINE * max(len(broken) - 1, 0)
    names = [text.get_text() for text in axes.get_xticklabels()]
    if any(name[:1].isalpha() for name in names) and sum(map(len, names)) * _INCHES_PER_LETTER > wide:
        axes.tick_params(axis="x", rotation=90)
        below = max(below, _INCHES_PER_LETTER * max(map(len, names)) + 0.2)
    _upright_values(axes, wide)
    return _Panel(axes, own, _TITLE if axes.get_title(loc="left") else _GAP, below)


def _upright_values(axes: Axes, wide: float) -> None:
    """Turn the values above bars that stand too close for them to lie."""
    bars = [bar for group in axes.containers if isinstance(group, BarContainer) for bar in group]
    values = [text for text in axes.texts if isinstance(text, Annotation)]
    if not values or not bars or any(bar.get_x() == 0 for bar in bars):
        return  # none, or bars that lie
    if wide / len(values) < _BAR_PITCH:
        for text in values:
            text.set_rotation(90)
        axes.margins(y=0.3)
        axes.autoscale_view()
