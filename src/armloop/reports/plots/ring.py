"""The loop as one picture: eight stages on a ring, each with a small figure and its key number."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from armloop.reports.plots.style import BLUE, GRID, INK, MUTED, SURFACE, thin
from armloop.reports.words import number
from armloop.util.arrays import Array

# All lengths in inches, the figure's own unit.
_WIDTH, _HEIGHT = 12.8, 6.9
_CARD_WIDTH, _CARD_HEIGHT = 2.66, 2.34
_MARGIN, _BOTTOM = 0.42, 0.36
#: On a page as narrow as a phone's: a column, and the room between its cards.
_NARROW_WIDTH, _NARROW_CARD, _NARROW_GAP = 4.0, 3.4, 0.34
_PER_ROW = 4
_SPARK_POINTS = 400


@dataclass(frozen=True)
class Stage:
    """A stage of the loop.

    Attributes:
        title: a word or two.
        figure: its key number with unit, or a verdict.
        text: one short line that says what the number is.
        draw: draws the small figure on bare axes.
        color: of the stage.
    """

    title: str
    figure: str
    text: str
    draw: Callable[[Axes], None]
    color: str = BLUE


def ring_figure(stages: Sequence[Stage], headline: str, line: str) -> Figure:
    """Eight stages clockwise on a ring, from the upper left, with a headline and a line of text inside.

    Raises:
        ValueError: there are not eight stages.
    """
    if len(stages) != 2 * _PER_ROW:
        raise ValueError(f"the ring has room for {2 * _PER_ROW} stages, there are {len(stages)}")
    made, page = _blank(_WIDTH, _HEIGHT)
    places = _places()
    _track(page, places)
    for k, (stage, place) in enumerate(zip(stages, places, strict=True)):
        _card(made, page, k + 1, stage, (*place, _CARD_WIDTH))
    middle = 0.5 * _HEIGHT
    center: dict[str, Any] = {"ha": "center", "va": "center"}
    page.text(0.5 * _WIDTH, middle + 0.2, headline, color=INK, fontsize=17, fontweight="bold", **center)
    page.text(0.5 * _WIDTH, middle - 0.27, line, color=MUTED, fontsize=11.5, **center)
    return made


def column_figure(stages: Sequence[Stage], headline: str, line: str) -> Figure:
    """The ring of :func:`ring_figure` for a narrow page: its stages one below the other, and the way back at the side."""
    words = [*textwrap.wrap(headline, 38), ""], textwrap.wrap(line, 50)
    head = 0.3 + 0.22 * len(words[0]) + 0.19 * len(words[1])
    pitch = _CARD_HEIGHT + _NARROW_GAP
    height = head + pitch * len(stages)
    made, page = _blank(_NARROW_WIDTH, height)
    page.text(0.12, height - 0.1, "\n".join(words[0]), color=INK, fontsize=13, fontweight="bold", va="top")
    under = height - 0.1 - 0.22 * len(words[0])
    page.text(0.12, under, "\n".join(words[1]), color=MUTED, fontsize=9.5, va="top", linespacing=1.3)
    x, at = 0.12, height - head
    middle = x + 0.5 * _NARROW_CARD
    for k, stage in enumerate(stages):
        _card(made, page, k + 1, stage, (x, at - _CARD_HEIGHT, _NARROW_CARD))
        if k + 1 < len(stages):
            _arrow(page, (middle, at - _CARD_HEIGHT - 0.04), (middle, at - pitch + 0.02))
        at -= pitch
    edge, first, last = x + _NARROW_CARD, height - head - 0.5 * _CARD_HEIGHT, at + pitch - 0.5 * _CARD_HEIGHT
    page.plot([edge, edge + 0.3, edge + 0.3], [last, last, first], color=INK, linewidth=2)
    _arrow(page, (edge + 0.3, first), (edge + 0.02, first))
    return made


def _blank(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure, and axes over all of it that count inches."""
    made = Figure(figsize=(width, height), dpi=110)
    made.patch.set_alpha(0.0)
    page = made.add_axes((0, 0, 1, 1))
    page.set_xlim(0, width)
    page.set_ylim(0, height)
    page.axis("off")
    return made, page


def _places() -> list[tuple[float, float]]:
    """Lower left corners of the cards, clockwise from the upper left one."""
    pitch = (_WIDTH - 2 * _MARGIN - _CARD_WIDTH) / (_PER_ROW - 1)
    columns = [_MARGIN + k * pitch for k in range(_PER_ROW)]
    top = _HEIGHT - _BOTTOM - _CARD_HEIGHT
    return [*((x, top) for x in columns), *((x, _BOTTOM) for x in reversed(columns))]


def _track(page: Axes, places: Sequence[tuple[float, float]]) -> None:
    """The band that the cards lie on, and an arrow wherever it shows between two of them."""
    left, right = _MARGIN + 0.5 * _CARD_WIDTH, _WIDTH - _MARGIN - 0.5 * _CARD_WIDTH
    low, high = _BOTTOM + 0.5 * _CARD_HEIGHT, _HEIGHT - _BOTTOM - 0.5 * _CARD_HEIGHT
    page.add_patch(
        FancyBboxPatch(
            (left, low),
            right - left,
            high - low,
            boxstyle="round,pad=0,rounding_size=0.6",
            facecolor="none",
            edgecolor=GRID,
            linewidth=15,
        )
    )
    half, apart = 0.5 * np.array([_CARD_WIDTH, _CARD_HEIGHT]), np.array([0.05, 0.22])
    centres = np.array(places) + half
    for here, there in zip(centres, np.roll(centres, -1, axis=0), strict=True):
        to_edge = np.sign(np.round(there - here, 6)) * (half + apart)
        _arrow(page, here + to_edge, there - to_edge)


def _arrow(page: Axes, tail: Sequence[float] | Array, tip: Sequence[float] | Array) -> None:
    page.add_patch(
        FancyArrowPatch(
            (tail[0], tail[1]),
            (tip[0], tip[1]),
            arrowstyle="-|>",
            mutation_scale=17,
            color=INK,
            linewidth=2,
            shrinkA=0,
            shrinkB=0,
        )
    )


def _card(made: Figure, page: Axes, count: int, stage: Stage, place: tuple[float, float, float]) -> None:
    """A stage's card at ``place``: x and y of its lower left corner, and its width."""
    x, y, wide = place
    page.add_patch(
        FancyBboxPatch(
            (x, y),
            wide,
            _CARD_HEIGHT,
            boxstyle="round,pad=0,rounding_size=0.14",
            facecolor=SURFACE,
            edgecolor=stage.color,
            linewidth=1.6,
            zorder=3,
        )
    )
    top = y + _CARD_HEIGHT - 0.29
    page.scatter([x + 0.3], [top], s=330, color=stage.color, zorder=4, linewidths=0)
    page.text(
        x + 0.3,
        top - 0.008,
        str(count),
        color=SURFACE,
        fontsize=11,
        fontweight="bold",
        ha="center",
        va="center",
        zorder=5,
    )
    page.text(x + 0.56, top, stage.title, color=INK, fontsize=12.5, fontweight="bold", va="center", zorder=5)
    page.text(
        x + 0.18,
        y + 0.5,
        stage.figure,
        color=stage.color,
        fontsize=14 if len(stage.figure) < 22 else 11,
        fontweight="bold",
        va="center",
        zorder=5,
    )
    # so that it stays within the card
    size = min(9.0, 9.0 * 37 / max(len(stage.text), 1))
    page.text(x + 0.18, y + 0.2, stage.text, color=MUTED, fontsize=size, va="center", zorder=5)
    width, height = made.get_size_inches()
    axes = made.add_axes(
        (
            (x + 0.18) / width,
            (y + 0.78) / height,
            (wide - 0.36) / width,
            (_CARD_HEIGHT - 1.36) / height,
        ),
        facecolor="none",
        zorder=6,
    )
    axes.axis("off")
    stage.draw(axes)


def lines(
    x: Array,
    ys: Sequence[Array],
    colors: Sequence[str],
    band: float | None = None,
    limit: float | None = None,
    first_wide: bool = False,
) -> Callable[[Axes], None]:
    """Small lines over one another.

    ``band`` shades ±band, ``limit`` fixes the height to ±limit, ``first_wide`` draws the first line wide and
    pale, so that one that agrees with it can be seen upon it.
    """

    def draw(axes: Axes) -> None:
        if band is not None:
            axes.axhspan(-band, band, color=GRID, linewidth=0)
        for k, (y, color) in enumerate(zip(ys, colors, strict=True)):
            wide = first_wide and k == 0
            axes.plot(
                *thin(x, y, _SPARK_POINTS),
                color=color,
                linewidth=4 if wide else 1.3,
                alpha=0.5 if wide else 1,
            )
        axes.margins(x=0)
        if limit is not None:
            axes.set_ylim(-limit, limit)

    return draw


def bars(values: Sequence[float], colors: Sequence[str], labels: Sequence[str]) -> Callable[[Axes], None]:
    """A few horizontal bars with a word before and the value behind each."""

    def draw(axes: Axes) -> None:
        largest = max([*values, 1e-12])
        for k, (value, color, label) in enumerate(zip(values, colors, labels, strict=True)):
            axes.barh(k, value, 0.62, color=color)
            axes.text(-0.03 * largest, k, label, color=MUTED, fontsize=8.5, ha="right", va="center")
            axes.text(value + 0.03 * largest, k, number(value, 2), color=INK, fontsize=8.5, va="center")
        axes.set_xlim(-0.62 * largest, 1.3 * largest)
        axes.set_ylim(len(values) - 0.4, -0.6)

    return draw
