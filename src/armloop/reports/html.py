"""A report: sections of text, tables, formulas and figures, as one HTML file that needs nothing else.

Figures go in as SVG whose frame and text colours follow the page, light or dark; dense parts of them are
rasterised. Nothing is loaded from anywhere.
"""

from __future__ import annotations

import io
import pickle
import re
from dataclasses import asdict, dataclass, field
from typing import Any

import matplotlib
import msgspec
from jinja2 import Environment, PackageLoader
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from armloop import __version__
from armloop.reports.plots.narrow import stack
from armloop.reports.plots.style import GRID, INK, MUTED, SURFACE
from armloop.reports.tables import Table
from armloop.reports.words import spelled
from armloop.util.workers import Processes, team_size

_THEME = {INK: "var(--ink)", MUTED: "var(--muted)", GRID: "var(--grid)", SURFACE: "var(--surface)"}
_DPI = 150
#: Blanks that no line should end at: before a unit or %, after ± and arrows.
_TIES = re.compile(
    r"(?<=[±→×]) | (?=[%±])|(?<=joint) (?=\d)|(?<=\d) (?=(?:N|kg|m|s|ms|rad|A|Hz|×)(?:[·/²³,.;:)]|\s|$))"
)
_OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*\b")
#: Width on the page of an inch of a figure, rem: its labels are then about as large as the text.
_REM_PER_INCH = 6.4
#: Letters of a table's line that a phone has room for.
_LETTERS = 42


@dataclass(frozen=True)
class Picture:
    """A figure with a caption that says what it shows; with a ``summary``, folded away behind it until asked for.

    ``figure`` may be drawn already: the text of :func:`svg`. ``narrow`` is shown instead on a page as narrow as a
    phone's, where rearranging the figure's panels would not do.
    """

    figure: Figure | str
    caption: str = ""
    summary: str = ""
    narrow: Figure | None = None

    def svg(self) -> str:
        """As :func:`svg`."""
        return svg(self.figure, self.narrow)


@dataclass(frozen=True)
class Card:
    """A headline figure: a number in large type, what it is, and a word on it."""

    figure: str
    title: str
    text: str = ""
    tone: str = "plain"


@dataclass(frozen=True)
class Section:
    """A part of a report.

    Attributes:
        title: heading; it appears in the table of contents.
        text: paragraphs that say what was done, why, and what the figures show.
        tables, pictures: shown in this order after the text.
        formulas: (summary, preformatted text) pairs, folded away until asked for.
        notes: remarks that the reader must not miss.
    """

    title: str
    text: list[str] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    formulas: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values, figures drawn."""
        pictures = [[p.svg(), p.caption, p.summary] for p in self.pictures]
        return {**vars(self), "pictures": pictures, "tables": [asdict(table) for table in self.tables]}

    @staticmethod
    def from_dict(data: dict[str, Any]) -> Section:
        """Rebuild from :meth:`to_dict`."""
        pictures = [Picture(*parts) for parts in data["pictures"]]
        tables = msgspec.convert(data["tables"], list[Table])
        formulas = [tuple(pair) for pair in data["formulas"]]
        return Section(**{**data, "pictures": pictures, "tables": tables, "formulas": formulas})

    @property
    def anchor(self) -> str:
        """The section's identifier within the page."""
        return re.sub(r"[^a-z0-9]+", "-", self.title.lower()).strip("-")


@dataclass(frozen=True)
class Report:
    """A whole page: a title, a sentence or two, headline cards, links to files beside it, sections."""

    title: str
    lead: str
    sections: list[Section]
    cards: list[Card] = field(default_factory=list)
    links: list[tuple[str, str]] = field(default_factory=list)
    hero: Picture | None = None


def render(report: Report, jobs: int | None = None) -> str:
    """Render a report as one self-contained HTML page, its figures drawn side by side.

    Args:
        jobs: in how many processes, as of :func:`armloop.util.workers.team_size`.
    """
    pictures = [picture for section in report.sections for picture in section.pictures]
    pictures += [report.hero] if report.hero else []
    texts = Processes(team_size(jobs)).map(Picture.svg, pictures)
    drawn = {id(picture): text for picture, text in zip(pictures, texts, strict=True)}
    environment = Environment(
        loader=PackageLoader("armloop.reports"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["svg"] = lambda picture: Markup(drawn[id(picture)])
    environment.filters["prose"] = prose
    environment.filters["parted"] = parted
    environment.tests["wide"] = wide
    return environment.get_template("report.html").render(report=report, version=__version__)


def prose(text: str) -> Markup:
    """A sentence as HTML: tied, a command's options as code."""
    return Markup(_OPTION.sub(r"<code>\g<0></code>", str(escape(tied(text)))))


def parted(text: str) -> Markup:
    """As :func:`prose`, in a narrow place: a line may end before ±, rather than within a number."""
    return prose(text).replace("\u00a0±", " ±")


def wide(table: Table) -> bool:
    """Whether a table is wider than a phone even with every cell parted at its blanks; two letters between columns."""
    columns = zip(table.headers, *table.rows, strict=True)
    words = [max(len(word) for cell in column for word in tied(cell).split(" ")) for column in columns]
    return sum(words) + 2 * len(words) > _LETTERS


def tied(text: str) -> str:
    """Keep a number's sign, error and unit on one line with it; % stands apart from its number, as everywhere."""
    return _TIES.sub("\u00a0", spelled(text))


def svg(figure: Figure | str, narrow: Figure | None = None) -> str:
    """A figure as ``<svg>`` elements that take their frame colours from the page; one drawn already as it is.

    A figure of several panels comes twice, as drawn and with its panels one below the other: the page shows the one
    that suits its width. ``narrow`` is the second one where it is a figure of its own. The figure itself stays as it is.
    """
    if isinstance(figure, str):
        return figure
    wide = _drawn(figure, "wide")
    if narrow is None:
        # A copy of our own making: the figure stays as it is for whoever shows or draws it again.
        narrow = pickle.loads(pickle.dumps(figure))
        if not stack(narrow):
            return wide
    return wide + _drawn(narrow, "narrow")


def _drawn(figure: Figure, variant: str) -> str:
    """One ``<svg>`` of the class ``variant``."""
    text = io.StringIO()
    # A fixed salt makes equal figures equal text; without a date the file does not change from run to run. Each variant
    # has identifiers of its own, for what is hidden must not be referred to.
    with matplotlib.rc_context({"svg.hashsalt": f"armloop {variant}", "svg.fonttype": "path"}):
        # without its background: the page has its own, light or dark
        figure.savefig(text, format="svg", dpi=_DPI, metadata={"Date": None}, transparent=True)
    body = text.getvalue()
    body = body[body.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r"<!--.*?-->\n?", "", body, flags=re.DOTALL)
    body = re.sub(
        r' id="(?:figure|axes|patch|text|line2d|matplotlib|xtick|ytick|legend)[\w.]*_\d+"', "", body
    )
    body = re.sub(r'(?<= d=")[^"]*', _shorter, body)
    for color, variable in _THEME.items():
        body = body.replace(color, variable)
    # the page decides the width; the view box keeps the proportions
    body = re.sub(r' (?:width|height)="[\d.]+pt"', "", body, count=2)
    width = f"--width:{_REM_PER_INCH * figure.get_figwidth():.1f}rem"
    return body.replace("<svg ", f'<svg class="{variant}" style="{width}" role="img" ', 1)


def _shorter(match: re.Match[str]) -> str:
    """Coordinates to a hundredth of a point: finer than any screen."""
    return re.sub(r"(\d\.\d\d)\d+", r"\1", match[0]).replace("\n", " ")
