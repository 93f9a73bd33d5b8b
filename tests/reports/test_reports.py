"""A report is one file that needs nothing else, and says what the results say."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import pytest
from matplotlib.text import Text

from armloop.diagnosis import Diagnosis, close
from armloop.diagnosis.unlisted import Unlisted
from armloop.reports.diagnosis_report import diagnosis_report
from armloop.reports.html import Card, Report, Section, prose, render, tied, wide
from armloop.reports.loop_report import loop_report
from armloop.reports.loop_stages import loop_figure
from armloop.reports.tables import make_table
from armloop.reports.words import number, with_error

# written without an end tag
_VOID = {"meta", "link", "br", "img"}


class Page(HTMLParser):
    """Collects addresses and checks that tags are nested."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.anchors: list[str] = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in _VOID:
            self.open.append(tag)
        given = dict(attributes)
        self.addresses += [given[key] or "" for key in ("href", "src", "xlink:href") if key in given]
        self.anchors += [given["id"] or ""] if tag == "section" else []

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(loop: SimpleNamespace) -> str:
    return loop_report(loop)


def test_nothing_is_loaded_from_elsewhere(page: str) -> None:
    outward = {a for a in Page(page).addresses if not a.startswith(("#", "data:image/png"))}
    assert outward == {"replay.html"}
    assert "url(http" not in page and "<script" not in page
    assert len(page) < 6e6


def test_the_rings_caption_ends_with_the_verdict(loop: SimpleNamespace) -> None:
    figure = loop_figure(loop)
    words = " ".join(text.get_text() for text in figure.findobj(Text) if isinstance(text, Text))
    assert re.search(r"verdict was right(?!;)", words) and not re.search(r";\s*;|right;", words)


@pytest.fixture
def _undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages of which the words alone are looked at: their figures are made, and not written out."""
    monkeypatch.setattr("armloop.reports.html._drawn", lambda figure, variant: "<svg></svg>")


def test_contents_lead_to_sections(page: str) -> None:
    parsed = Page(page)
    assert len(set(parsed.anchors)) == len(parsed.anchors) >= 8
    assert {f"#{anchor}" for anchor in parsed.anchors} <= set(parsed.addresses)


def test_figures_take_the_pages_colours(page: str) -> None:
    assert "var(--ink)" in page and "prefers-color-scheme: dark" in page
    assert "#1b2430" not in page.partition("</style>")[2]


def test_the_loops_numbers_are_the_results(page: str, loop: SimpleNamespace) -> None:
    assert "joint spring, joint 2" in page and "the verdict was right" in page
    for eta in loop.tracking_after.eta:
        assert f">{number(float(eta))}</td>" in page
    stiffness = loop.diagnosis.outcome.added()[0].parameters["stiffness"]
    assert with_error(stiffness.value, stiffness.std_error) in page.replace("\xa0", " ")
    assert "&lt;angle&gt;" in page


@pytest.mark.usefixtures("_undrawn")
def test_a_wrong_verdict_is_admitted_and_what_is_not_there_has_no_link(
    loop: SimpleNamespace, clean: Diagnosis
) -> None:
    text = loop_report(
        SimpleNamespace(**{**vars(loop), "diagnosis": clean, "right": False, "reference": None}), replay=None
    )
    assert "the verdict was wrong" in text and "no effect" in text
    assert "One-shot SINDy" not in text and "replay.html" not in text


def test_the_picture_has_eight_small_figures(loop: SimpleNamespace) -> None:
    assert len(loop_figure(loop).axes) == 9


@pytest.mark.usefixtures("_undrawn")
def test_a_diagnosis_page(loop: SimpleNamespace, clean: Diagnosis) -> None:
    found = diagnosis_report(loop.diagnosis, loop.reconstruction.model)
    assert "Diagnosis: joint spring, joint 2" in found and re.search(r"tau1 = ", found)
    nothing = diagnosis_report(clean, loop.reconstruction.model)
    assert "Diagnosis: no effect" in nothing
    assert not [a for a in Page(found + nothing).addresses if a.startswith("http")]


@pytest.mark.usefixtures("_undrawn")
def test_an_unlisted_law_is_shown(loop: SimpleNamespace, clean: Diagnosis) -> None:
    law = Unlisted(2, 3.2, 1.5, "0.48*cos(q2)^2*v2", 1.6)
    text = diagnosis_report(
        replace(clean, verdict="unlisted_effect", unlisted=law), loop.reconstruction.model
    )
    assert "Diagnosis: unlisted effect, joint 2" in text and "it follows 0.48*cos(q2)^2*v2" in text


def test_every_joint_has_its_residual_and_what_the_controller_adds(loop: SimpleNamespace) -> None:
    model = loop.reconstruction.model
    closing = close(model, loop.diagnosis.model, loop.diagnosis.samples)
    text = diagnosis_report(loop.diagnosis, model, closing)
    assert "What is left, on its own scale" in text and "What it changes" in text
    rms = number(float(closing.feedforward.rms[1]))
    assert f">{rms}</td>" in text
    assert len(text) < 3e6
    assert not [a for a in Page(text).addresses if a.startswith("http")]


def test_a_number_keeps_its_error_and_unit() -> None:
    assert tied("joint 2: 0.71 ± 0.01 N·m, 99 %") == "joint\u00a02: 0.71\u00a0±\u00a00.01\u00a0N·m, 99\u00a0%"
    assert tied("2 numbers and 3 more") == "2 numbers and 3 more"


def test_a_line_of_a_narrow_place_ends_between_two_numbers() -> None:
    text = render(
        Report("a", "b", [Section("c", tables=[make_table(["d"], [["7 ± 1"]])])], [Card("0.71 ± 0.01", "e")])
    )
    assert ">0.71 ±\u00a00.01</p>" in text and ">7 ±\u00a01</td>" in text


def test_a_percentage_stands_apart_from_its_sign() -> None:
    assert tied("it leaves 54% of 1.5 % and 50 %") == "it leaves 54\u00a0% of 1.5\u00a0% and 50\u00a0%"


def test_a_command_s_options_are_code() -> None:
    assert (
        prose("it is < 1 with --next-run: well-known")
        == "it is &lt; 1 with <code>--next-run</code>: well-known"
    )


def test_a_table_is_wide_by_what_cannot_be_parted() -> None:
    assert not wide(make_table(["a reference of several words", "b"], [["cells of several words"] * 2]))
    assert wide(make_table(["a"], [["1" * 41]])) and not wide(make_table(["a"], [["1" * 40]]))
    assert wide(make_table([f"joint {j}" for j in range(1, 7)], [["2.77 ± 0.02"] * 6]))


def test_text_cannot_become_markup() -> None:
    text = render(Report("<b>", "a & b", [Section("<i>", ["<u>"])], [Card("<s>", "<q>")]))
    assert not {"<b>", "<i>", "<u>", "<s>", "<q>"} & set(re.findall(r"<[^>]*>", text))
