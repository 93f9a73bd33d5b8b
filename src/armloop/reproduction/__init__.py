"""The paper, table by table: every table and figure with numbers in it, ours beside the paper's."""

from armloop.reproduction.context import Context
from armloop.reproduction.outcome import Outcome
from armloop.reproduction.registry import BEYOND, ITEMS, PAPER, chosen, run_item

__all__ = ["BEYOND", "ITEMS", "PAPER", "Context", "Outcome", "chosen", "run_item"]
