"""Shapes of effects that are told apart by a letter."""


class Called(str):
    """A shape whose effect has parameters of its own."""

    proportion = None
