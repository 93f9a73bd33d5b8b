"""Type checks of what Python code hands in: paths, numbers, words; what a shell can give only as text is checked there."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armloop.util.errors import InputError, one_line

if TYPE_CHECKING:
    from armloop.util.arrays import Array

#: Drake's scalar types beside float.
_OF_DRAKE = {"AutoDiffXd", "Expression", "Variable"}
#: Characters of a value that a message shows.
_SHOWN = 60


def path_of(given: Any, what: str = "the path", error: type[InputError] = InputError) -> Path:
    """The path that was given; raises ``InputError`` (of the given class) where it is neither text nor a path."""
    if isinstance(given, str) or (isinstance(given, PathLike) and isinstance(given.__fspath__(), str)):
        return Path(given)
    raise error(f"{what} must be text or a pathlib.Path; it is of type {type(given).__name__}")


def _is_number(x: Any) -> bool:
    return type(x) is not bool and isinstance(x, Real) and isfinite(float(x))


def _is_whole(x: Any) -> bool:
    return type(x) is not bool and isinstance(x, Integral)


#: What an option can be, by the words that a message says it with.
_KINDS: dict[str, Callable[[Any], bool]] = {
    "a word": lambda x: isinstance(x, str),
    "a number": lambda x: isinstance(x, Real),
    "a finite number": _is_number,
    "a number above 0": lambda x: _is_number(x) and x > 0,
    "a whole number": _is_whole,
    "a whole number above 0": lambda x: _is_whole(x) and x > 0,
    "True or False": lambda x: type(x).__name__ in ("bool", "bool_"),  # numpy's, too
    "a function": callable,
}


def require(kind: str, **given: Any) -> None:
    """Raise ``InputError`` unless every option is of a kind, such as ``"a word"``, or ``"a finite number or None"``."""
    alone = kind.removesuffix(" or None")
    for name, value in given.items():
        if not (_KINDS[alone](value) or (value is None and alone != kind)):
            raise InputError(f"{name} must be {kind}; it is {shown(value)}")


def numbers_of(given: Any, shape: tuple[int, ...], what: str, each: str = "one per joint") -> Array:
    """What was given as an array of finite numbers of a shape; raises ``InputError`` where it is none."""
    import numpy as np

    found = _array(given)
    if found.shape != shape or not np.isfinite(found).all():
        size = " x ".join(map(str, shape))
        raise InputError(f"{what} must be {size} finite numbers, {each}; it is {shown(given)}")
    return found


def levels_of(given: Any, n: int, what: str) -> Array:
    """What was given, one number for all or one per joint, as (n,) finite numbers of at least 0; raises ``InputError``."""
    import numpy as np

    found = _array(given)
    found = found if found.ndim else np.full(n, found)
    if found.shape != (n,) or not (np.isfinite(found) & (found >= 0)).all():
        raise InputError(
            f"{what} must be {n} finite numbers of at least 0, one per joint; it is {shown(given)}"
        )
    return found


def _array(given: Any) -> Array:
    """What was given as an array; one that is not a number where it is no array of numbers."""
    import numpy as np  # not for those who only name a path

    try:
        found = np.asarray(given)
    except (TypeError, ValueError):
        return np.array(np.nan)
    return found.astype(np.float64) if found.dtype.kind in "fiu" else np.array(np.nan)


def shown(value: Any) -> str:
    """A value as a message shows it: itself where it is short, else its type and, of an array, its shape."""
    text = one_line(repr(value))
    if len(text) <= _SHOWN:
        return text
    text = f"of type {type(value).__name__}"
    shape, kind = getattr(value, "shape", None), getattr(getattr(value, "dtype", None), "kind", "")
    if isinstance(shape, tuple) and kind:
        text += f" and shape {shape}"
        if kind == "f" and not isfinite(value.sum()):
            text += ", with a number that is not finite"
        if kind == "O" and (elements := {type(x).__name__ for x in value.flat} & _OF_DRAKE):
            text += f", of {elements.pop()}s, for which there is armloop.drake.model_equations(model, T)"
    return text
