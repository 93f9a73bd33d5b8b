"""The items by name; each is a module with a function ``run(context) -> Outcome``, ``beyond_NAME`` if not the paper's."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

from armloop.util.errors import InputError
from armloop_paper.context import Context
from armloop_paper.outcome import Outcome

#: The paper's tables and figures with numbers in them, in the paper's order.
PAPER = ("fig1", "table2", "fig5", "fig6", "fig8", "fig9", "fig10", "fig11", "fig14", "fig15")
#: Studies beyond the paper: not part of a run that names no items.
BEYOND = ("estimators", "conditions", "coverage", "friction")
ITEMS = (*PAPER, *BEYOND)


def chosen(names: Sequence[str]) -> list[str]:
    """The items asked for in the paper's order, by default the paper's; raises ``InputError`` for an unknown one."""
    for name in names:
        if name not in ITEMS:
            raise InputError(f"unknown item {name!r}; there are: {', '.join(ITEMS)}")
    return [item for item in ITEMS if item in names] if names else list(PAPER)


def run_item(name: str, context: Context) -> Outcome:
    """Run one item."""
    module = f"beyond_{name}" if name in BEYOND else name
    outcome: Outcome = import_module(f"armloop_paper.{module}").run(context)
    return outcome
