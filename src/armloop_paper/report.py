"""The page and the terminal's text on how the paper's tables and figures come out here."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from armloop.reports.html import Card, Report, Section, render
from armloop.reports.tables import make_table, seconds_table

#: How a verdict is put, and the tone of its card.
_VERDICTS = {
    "agrees": ("agrees", "good"),
    "partly": ("agrees in part", "accent"),
    "differs": ("differs", "bad"),
    "beyond": ("beyond the paper", "plain"),
}


def terminal_text(name: str, section: Section, verdict: str, seconds: float) -> str:
    """An item for the terminal: its tables, then what they say."""
    title = f"── {name}: {section.title} — {_VERDICTS[verdict][0]} ({seconds:.0f} s) "
    parts = [title.ljust(110, "─"), *map(str, section.tables)]
    parts += [textwrap.fill(text, 110) for text in [*section.text, *(f"note: {n}" for n in section.notes)]]
    return "\n\n".join(parts) + "\n"


def reproduction_report(
    entries: Sequence[tuple[str, str, str, Section]], seconds: Mapping[str, float]
) -> str:
    """One HTML page: a card per verdict, a table of all items, a section per item.

    entries : name, headline, verdict and section of each item
    """
    verdicts = [verdict for _, _, verdict, _ in entries]
    cards = [
        Card(
            str(verdicts.count(verdict)),
            f"item{'s' if verdicts.count(verdict) != 1 else ''}: {words}",
            ", ".join(name for name, _, own, _ in entries if own == verdict),
            tone,
        )
        for verdict, (words, tone) in _VERDICTS.items()
        if verdict in verdicts
    ]
    rows = [[name, _VERDICTS[verdict][0], headline] for name, headline, verdict, _ in entries]
    overview = Section(
        "At a glance",
        ["Each line sets what was computed in this run beside what the paper prints."],
        tables=[make_table(["item", "verdict", "ours and the paper's"], rows, left=(0, 1, 2))],
    )
    account = Section("Account", tables=[seconds_table(seconds)])
    return render(
        Report(
            "The paper, table by table",
            "Guo, Xu, Zhang, Sun and Zhang, Model reconstruction of serial manipulators: a stepwise data-driven "
            "approach. Everything is computed anew; the paper's figures stand beside it.",
            [overview, *(section for _, _, _, section in entries), account],
            cards,
        )
    )
