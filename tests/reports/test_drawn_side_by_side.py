"""Figures of a page are drawn in several processes: the page is the same for any number of them."""

import os

import pytest

from armloop.reports import html
from armloop.reports.html import Picture, Report, Section, render
from armloop.reports.plots.style import figure


def pictures(count: int) -> list[Picture]:
    made = [figure(4.0, 2.0) for _ in range(count)]
    for k, each in enumerate(made):
        each.subplots().plot([0, k + 1], [0, 1])
    return [Picture(each, f"the slope is 1/{k + 1}") for k, each in enumerate(made)]


def page(jobs: int) -> str:
    first, second, hero = pictures(3)
    return render(
        Report("Slopes", "", [Section("One", [], [first]), Section("Two", [], [second])], hero=hero), jobs
    )


def test_a_page_does_not_depend_on_the_number_of_processes() -> None:
    assert page(1) == page(3)
    assert page(1).count('<svg class="wide"') == 3


def test_each_figure_stands_where_it_belongs_and_is_drawn_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        html,
        "svg",
        lambda figure, narrow: f"<svg>{figure.axes[0].lines[0].get_xdata()[1]} {os.getpid()}</svg>",
    )
    text = page(2)
    drawn = [part.split("</svg>")[0].split() for part in text.split("<svg>")[1:]]
    assert [x for x, _ in drawn] == ["3", "1", "2"]
    assert str(os.getpid()) not in {process for _, process in drawn}
