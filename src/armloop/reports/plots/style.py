"""Style of all figures: colours that stay apart for colour-blind eyes, light frames, few lines.

`INK`, `MUTED`, `GRID` and `SURFACE` are the colours of a light page; a report that is read on a dark page
exchanges exactly these.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial
from itertools import cycle
from typing import Any, Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.textpath import TextPath
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from armloop.util.arrays import Array

Grid = Literal["both", "x", "y"]

INK, MUTED, GRID, SURFACE = "#1b2430", "#5d6877", "#e3e7ec", "#fefefe"
BLUE, ORANGE, GREEN, PINK, GREY = "#2f7fd1", "#e8833a", "#12a284", "#c566a5", "#8791a1"
VIOLET, BROWN = "#6a2ff0", "#8c3e1c"

BEFORE, AFTER, BASELINE = ORANGE, BLUE, GREY
STEPS = {1: ORANGE, 2: GREEN, 3: BLUE}
CONDITIONS = {1: ORANGE, 2: GREEN, 3: BLUE}
CYCLE = (BLUE, ORANGE, GREEN, PINK, GREY)
#: Line styles and hatches of the first that has a colour, of the second and so on.
DASHES, HATCHES = ("-", (0, (5, 2)), (0, (1.5, 1.5))), ("", "////", "....")

#: More points than this on a line cannot be seen.
MOST_POINTS = 2000
_LETTERS = 9.5  # points
#: Sizes of a figure's legend in inches: of a row, what stands before a label, between columns, and left and right of all.
_ROW, _HANDLE, _BETWEEN, _SIDES = 0.21, 0.37, 0.27, 0.17


def controller_colors(names: Sequence[str]) -> dict[str, str]:
    """A colour per controller; the paper's three always have the same.

    No more than six stay apart for colour-blind eyes and on a dark page: what comes after has them again, see
    :func:`apart`.
    """
    fixed = {"pid": ORANGE, "pid_step1": GREEN, "pid_step3": BLUE}
    spare = cycle([PINK, VIOLET, BROWN, GREEN, ORANGE, BLUE])
    return {name: fixed.get(name) or next(spare) for name in names}


def apart(colors: Sequence[str], styles: Sequence[Any]) -> list[Any]:
    """A style for each colour, another one wherever it comes again."""
    return [styles[colors[:k].count(color) % len(styles)] for k, color in enumerate(colors)]


def figure(width: float = 10.0, height: float = 4.0) -> Figure:
    """Make an empty figure without pyplot's global state; white, so that a PNG of it can be read on any page."""
    return Figure(figsize=(width, height), dpi=110, facecolor="white")


def panels(
    target: Figure,
    rows: int = 1,
    columns: int = 1,
    *,
    left: float = 0.78,
    gap: float = 0.8,
    legend_row: bool = True,
    rows_gap: float = 0.5,
    bottom: float = 0.52,
    **options: Any,
) -> NDArray[np.object_]:
    """Divide a figure into (rows, columns) axes with margins in inches.

    Matplotlib's own layouts draw everything twice to measure the labels, which doubles the time of a report;
    here all labels have known sizes. ``left`` has room for the labels of the first column, ``gap`` for those
    of the others, ``rows_gap`` for those between rows, ``bottom`` for those below the last; ``legend_row`` keeps
    the top free for a legend. Further options go to ``Figure.subplots``.
    """
    width, height = target.get_size_inches()
    top = 0.62 if legend_row else 0.32
    between = 0.36 if options.get("sharex") else rows_gap
    target.subplots_adjust(
        left=left / width,
        right=1 - 0.16 / width,
        top=1 - top / height,
        bottom=bottom / height,
        wspace=gap / max((width - left - 0.16 - gap * (columns - 1)) / columns, 0.1),
        hspace=between / max((height - top - bottom - between * (rows - 1)) / rows, 0.1),
    )
    axes = target.subplots(rows, columns, squeeze=False, **options)
    return np.asarray(axes, dtype=object)


def room_for(names: Sequence[str]) -> float:
    """Inches left of a panel whose rows have names."""
    return 0.4 + 0.085 * max(map(len, names), default=0)


def polish(axes: Axes, xlabel: str = "", ylabel: str = "", title: str = "", grid: Grid = "both") -> Axes:
    """Give axes the common look: no box, a light grid, quiet ticks."""
    axes.set_facecolor("none")
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(GRID)
    axes.tick_params(which="both", colors=MUTED, labelsize=9, length=0, pad=4)
    axes.grid(True, axis=grid, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel(xlabel, color=MUTED, fontsize=9.5)
    axes.set_ylabel(ylabel, color=MUTED, fontsize=9.5)
    if title:
        axes.set_title(title, color=INK, fontsize=10.5, fontweight="bold", loc="left")
    return axes


def annotate(axes: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], **how: Any) -> None:
    """Write beside a point, ``offset`` in points from it."""
    axes.annotate(
        text, at, textcoords="offset points", xytext=offset, **{"color": INK, "fontsize": 9.5, **how}
    )


def legend_row(made: Figure, artists: Sequence[Artist], labels: Sequence[str], columns: int) -> Legend:
    """Add a frameless legend above a figure's axes, row by row; matplotlib fills it column by column."""
    how: dict[str, Any] = {"frameon": False, "fontsize": _LETTERS, "labelcolor": INK}
    where: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.02, 1.0)}
    order = _by_columns(len(labels), columns)
    names = [labels[k] for k in order]
    return made.legend([artists[k] for k in order], names, ncols=columns, **how, **where)


def _by_columns(count: int, columns: int) -> list[int]:
    """Which of ``count`` items that stand row by row is the first, second, .. if one reads column by column."""
    return [k for first in range(min(columns, count)) for k in range(first, count, columns)]


def _fitting(labels: Sequence[str], columns: int, width: float) -> int:
    """How many columns, at most ``columns``, fit into ``width`` inches; each is as wide as its longest label."""
    wide = [text_width(label) for label in labels]
    for count in range(min(columns, len(labels)), 1, -1):
        longest = [max(wide[first::count]) for first in range(count)]
        if (
            sum(longest) + _HANDLE * count + _BETWEEN * (count - 1) + _SIDES <= 0.96 * width
        ):  # hinted letters are a little wider
            return count
    return 1


@lru_cache(maxsize=256)
def text_width(label: str) -> float:
    """Width of a label, inches; letters fitted to pixels are a little wider than their outlines."""
    return 1.07 * float(TextPath((0, 0), label, size=_LETTERS).get_extents().width) / 72


def _add_room(made: Figure, rows: int) -> None:
    """Make a figure higher above its axes, which keep their size, by so many rows of a legend."""
    width, height = made.get_size_inches()
    higher = height + _ROW * rows
    kept = made.subplotpars
    made.subplots_adjust(
        bottom=kept.bottom * height / higher, top=kept.top * height / higher, hspace=kept.hspace
    )
    made.set_size_inches(width, higher)


def legend(target: Figure, columns: int = 4) -> None:
    """Add a frameless legend, each label once, above a figure's axes, which keep their size."""
    handles: dict[str, Artist] = {}
    for axes in target.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    artists, labels = list(handles.values()), list(handles)
    columns = _fitting(labels, columns, float(target.get_size_inches()[0]))
    made = legend_row(target, artists, labels, columns)
    if len(labels) > columns:
        _add_room(target, -(-len(labels) // columns) - 1)
    for shown in made.legend_handles:
        if isinstance(shown, Line2D):
            shown.set_linewidth(2.4)
        if isinstance(shown, PathCollection):  # dots as small as in the panel would not be seen
            shown.set_sizes([24.0])
        if shown is not None:
            shown.set_alpha(0.9)


def legend_above(made: Figure, width: float) -> float:
    """Lay a figure's legends out anew within ``width`` inches; returns the room they take above the axes, inches."""
    top = 0.1
    for shown in list(made.legends):
        entries = list(zip(shown.legend_handles, shown.get_texts(), strict=True))
        order = _by_columns(len(entries), shown._ncols)  # type: ignore[attr-defined]
        entries = [entries[order.index(k)] for k in range(len(entries))]
        shown.remove()
        artists, labels = [artist for artist, _ in entries], [text.get_text() for _, text in entries]
        letters = max(map(len, labels), default=1)
        columns = min(max(1, int((width - 0.3) / (0.08 * letters + 0.5))), max(len(labels), 1))
        legend_row(made, [artist for artist in artists if artist is not None], labels, columns)
        top += _ROW * -(-len(labels) // columns)
    return top


def thin(x: Array, y: Array, points: int = MOST_POINTS) -> tuple[Array, Array]:
    """Reduce a line (N,) to about ``points``, keeping the least and the largest value of every piece.

    NaN in y, which interrupts a line, is kept where a whole piece is NaN.
    """
    half = max(1, points // 2)
    if len(x) <= 2 * half:
        return x, y
    size = int(np.ceil(len(x) / half))
    pad = -len(x) % size
    rows = np.concatenate([y, np.full(pad, y[-1])]).reshape(-1, size)
    start = size * np.arange(len(rows))
    low = np.argmin(np.where(np.isnan(rows), np.inf, rows), axis=1)
    high = np.argmax(np.where(np.isnan(rows), -np.inf, rows), axis=1)
    keep = np.sort(np.column_stack([start + low, start + high]), axis=1).ravel()
    keep = np.minimum(keep, len(x) - 1)
    return x[keep], y[keep]


def trace(axes: Axes, x: Array, y: Array, **how: Any) -> None:
    """Draw a line (N,), interrupted where x jumps, with no more points than can be seen."""
    axes.plot(*thin(*with_gaps(x, y)), **how)


def every(count: int, most: int) -> slice:
    """Pick at most about ``most`` of ``count`` points, evenly."""
    return slice(None, None, max(1, int(np.ceil(count / most))))


def with_gaps(time: Array, values: Array) -> tuple[Array, Array]:
    """Interrupt a line (N,) where time jumps by more than ten steps, so that runs are not joined."""
    steps = np.diff(time)
    if len(steps) == 0:
        return time, values
    gaps = np.flatnonzero((steps > 10 * np.median(steps)) | (steps < 0)) + 1
    return np.insert(time, gaps, time[gaps]), np.insert(values, gaps, np.nan)


def percent_tick(x: float, _: object) -> str:
    """A tick's label for a share of one."""
    return f"{100 * x:.3g} %"


def log_percent(low: float, high: float) -> FuncFormatter:
    """Minor labels of a logarithmic axis in percent, the fewer the larger its span: all, 2 and 5, none."""
    labelled = tuple(range(2, 10)) if high < 3 * low else (2, 5) if high < 30 * low else ()
    return FuncFormatter(partial(_leading_percent, labelled))  # pickled with its figure


def _leading_percent(labelled: tuple[int, ...], x: float, _: object) -> str:
    leading = round(x / 10 ** np.floor(np.log10(x))) if x > 0 else 0
    return percent_tick(x, _) if leading in labelled else ""
