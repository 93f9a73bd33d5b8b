"""Least squares and sparse regression on normal equations; knows matrices only, no arm and no log."""
