"""The paper, table by table: every table and figure with numbers in it, ours beside the paper's."""

from armloop_paper.context import Context
from armloop_paper.outcome import Outcome
from armloop_paper.registry import BEYOND, ITEMS, PAPER, chosen, run_item

__all__ = ["BEYOND", "ITEMS", "PAPER", "Context", "Outcome", "chosen", "run_item"]
