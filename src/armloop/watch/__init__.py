"""Watching arms for years: a store of sums, sequential tests with a promise, and a diagnosis behind every alarm."""

from armloop.watch.run import Options, Outcome, watch

__all__ = ["Options", "Outcome", "watch"]
