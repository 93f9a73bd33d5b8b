"""Elementary functions handed to laws that serve several kinds of numbers.

A law written in plain arithmetic and these functions runs on Python's floats (`MATH`), on arrays of samples
(`NUMPY`), and, with the functions that `armloop.drake` hands in, on AutoDiffXd and symbolic Expressions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Function = Callable[[Any], Any]


@dataclass(frozen=True)
class Functions:
    """Functions of one number; `sign` is -1, 0 or 1. The absolute value is Python's own `abs`.

    `clip(x, lower, upper)` takes two bounds.
    """

    sin: Function
    cos: Function
    exp: Function
    tanh: Function
    sqrt: Function
    sign: Function
    clip: Callable[[Any, Any, Any], Any]


MATH = Functions(
    math.sin,
    math.cos,
    math.exp,
    math.tanh,
    math.sqrt,
    lambda x: (x > 0) - (x < 0),
    lambda x, lower, upper: min(max(x, lower), upper),
)  # for a single sample several times faster than numpy's
NUMPY = Functions(np.sin, np.cos, np.exp, np.tanh, np.sqrt, np.sign, np.clip)
