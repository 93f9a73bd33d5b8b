"""A command's parser, its checks and its function's defaults come from one class."""

from __future__ import annotations

import argparse

import pytest

from armloop.commands.options import Options, argument, flag, option, positive, required, several, within
from armloop.commands.reconstruct import Reconstruct
from armloop.laws.friction import FRICTION_LAWS
from armloop.regression.estimators import LISTED
from armloop.util.errors import InputError


class Shared(Options):
    group = "what others have, too"

    tip: str | None = option("the last link", metavar="LINK")
    speed: float = option("of all (%(default)g)", 2.0, check=positive("give a positive speed"))


class Example(Shared):
    logs: list[str] = argument("LOG", "what is read", nargs="+")
    out: str = required("what is written")
    max_order: int = option("largest (%(default)s)", 4, check=within(1, 6, "give 1 to 6"))
    lock: list[str] = several("may be repeated", "JOINT=VALUE")
    fast: bool = flag("do it fast", but_not="pace")
    slow: bool = flag("do it slowly", but_not="pace")
    speed: float = option("of this one (%(default)g)", 3.0, check=positive("give a positive speed"))


def parsed(*words: str) -> Example:
    parser = argparse.ArgumentParser(exit_on_error=False)
    Example.declare(parser)
    return Example(vars(parser.parse_args(words)))


def test_a_class_gives_defaults_and_an_object_what_was_given() -> None:
    given = parsed("a", "b", "--out", "x", "--max-order", "2", "--lock", "j=1", "--lock", "k=2", "--fast")
    assert (given.logs, given.out, given.max_order, given.lock) == (["a", "b"], "x", 2, ["j=1", "k=2"])
    assert given.fast is True and given.slow is False and given.tip is None and given.speed == 3.0
    assert Example.max_order == 4 and Example.lock == [] and Example.fast is False and Shared.speed == 2.0
    assert parsed("a", "--out", "x").lock == []


def test_what_excludes_each_other_is_refused() -> None:
    with pytest.raises(argparse.ArgumentError, match="not allowed with"):
        parsed("a", "--out", "x", "--fast", "--slow")


@pytest.mark.parametrize(
    ("name", "value", "wrong"),
    [
        ("max_order", 7, "give 1 to 6"),
        ("speed", 0.0, "give a positive speed"),
    ],
)
def test_a_value_out_of_bounds_is_named_as_it_was_given(name: str, value: float, wrong: str) -> None:
    option_name = f"--{name.replace('_', '-')}"
    with pytest.raises(InputError, match=f"^{option_name} {value:g}: {wrong}"):
        parsed("a", "--out", "x", option_name, str(value))
    with pytest.raises(InputError, match=f"^{name} {value:g}: {wrong}"):
        Example.checked(**{name: value})
    with pytest.raises(InputError, match=r"^--speed nan: give a positive speed"):
        parsed("a", "--out", "x", "--speed", "nan")
    Example.checked(max_order=6, speed=0.1, tip=None)


@pytest.mark.parametrize(
    ("name", "value", "kind"),
    [
        ("max_order", 2.0, "a whole number"),
        ("speed", float("inf"), "a finite number"),
        ("tip", 3, "a word or None"),
        ("out", None, "a word"),
        ("fast", 1, "True or False"),
    ],
)
def test_a_value_of_another_type_is_named(name: str, value: object, kind: str) -> None:
    with pytest.raises(InputError, match=f"^{name} must be {kind}; it is {value}$"):
        Example.checked(**({"max_order": 7} | {name: value}))  # before any value that is out of bounds


def test_shared_options_stand_under_their_heading() -> None:
    parser = argparse.ArgumentParser(prog="example")
    Example.declare(parser)
    own, _, shared = parser.format_help().partition("what others have, too:")
    assert "--max-order" in own and "largest (4)" in own and "of this one" not in own
    assert "--tip LINK" in shared and "of this one (3)" in shared


def test_the_help_names_every_estimator_and_friction_law_that_there_is() -> None:
    parser = argparse.ArgumentParser()
    Reconstruct.declare(parser)
    text = " ".join(parser.format_help().split())
    assert not [name for name in (*LISTED, *FRICTION_LAWS) if name not in text]
