"""Scalar-type support: elementary functions for each of Drake's scalar types, and vectors of one type."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pydrake.math as drake_math
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression, if_then_else

from armloop.util.functions import MATH, Functions


def _clip(x: Any, lower: Any, upper: Any) -> Any:
    return drake_math.max(drake_math.min(x, upper), lower)


_COMMON = (drake_math.sin, drake_math.cos, drake_math.exp, drake_math.tanh, drake_math.sqrt)
_FUNCTIONS: dict[type, Functions] = {
    float: MATH,
    AutoDiffXd: Functions(*_COMMON, lambda x: float(x > 0.0) - float(x < 0.0), _clip),
    Expression: Functions(
        *_COMMON, lambda x: if_then_else(x > 0.0, 1.0, if_then_else(x < 0.0, -1.0, 0.0)), _clip
    ),
}


def functions_of(T: type) -> Functions:
    """Return the elementary functions of one of Drake's scalar types; sign has the derivative 0."""
    return _FUNCTIONS[T]


def within(T: type, time: Any, start: float, end: float) -> Any:
    """Return 1 from start to end, both in s and end left out, else 0, as a plain number or an Expression."""
    if T is Expression:
        return if_then_else(time >= start, if_then_else(time < end, 1.0, 0.0), 0.0)
    return float(start <= time < end)


def vector(T: type, values: Sequence[Any]) -> np.ndarray:
    """Return (n,) values of one type, plain numbers among them converted."""
    if T is float:
        return np.array(values, dtype=float)
    return np.array([x if isinstance(x, T) else T(x) for x in values], dtype=object)
