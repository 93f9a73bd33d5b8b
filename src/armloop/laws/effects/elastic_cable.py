"""Elastic cable: a hose, a cord or a spring from a fixed point to a link, which pulls once it is stretched.

A spring pushes, too, while it is shorter than when it rests.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armloop.laws.effects.base import (
    Array,
    Context,
    Effect,
    Estimate,
    Parameter,
    StateLaw,
    Value,
    Values,
    number,
    with_error,
)
from armloop.robot.arm import Arm
from armloop.robot.newton_euler import Vector, point_torques
from armloop.util.functions import NUMPY, Functions

#: Part of its stiffness by which a cable that a run determines is off, at most: two standard errors.
_SURE = 0.5
#: m²: so near to its anchor a cable has no direction.
_NOTHING = 1e-18


@dataclass(frozen=True)
class Cable:
    """Where a cable runs: from its anchor in the base frame to a point in the frame of a link (from 1), m; and how long it
    is while it is slack, m; and whether it pushes where it is shorter, as a spring does. ``errors`` are standard errors of
    stiffness, slack length, anchor, point and link (9,).
    """

    link: int
    anchor: Vector
    attached: Vector
    slack_length: float
    pushes: bool = False
    errors: tuple[float, ...] = (np.nan,) * 9

    @property
    def key(self) -> float:
        """A number that tells its columns from those of other cables."""
        return float(hash((self.link, self.anchor, self.attached, self.slack_length, self.pushes)) % 2**52)


class ElasticCable(Effect):
    """tau += J(q)ᵀ F, F = k max(L − L_0, 0) (p − a)/L, L = |p − a|: the gradient of the energy k (L − L_0)²/2 of a stretch.

    p is the place of a point of a link, a the anchor, which rests; of a spring, which ``pushes``, F = k (L − L_0) (p − a)/L.
    What is slack for a part of the time looks like one push after the other, and what never is like springs of several
    joints. Linear in its stiffness alone: where it runs is found by :mod:`armloop.diagnosis.cables`.

    Args:
        cables: where it may run, as found on all data and on parts of them.
    """

    name = "elastic_cable"
    scope = "arm"
    searched = False
    parameters = (
        Parameter("stiffness", "N/m", least=0.0, positive=True),
        Parameter("slack_length", "m", least=0.0),
        Parameter("anchor", "m", size=3),
        Parameter("attached", "m", size=3),
        Parameter("link", above=0.0),
        Parameter("pushes", default=0.0),
    )
    needs_model = False
    complexity = 8
    load = True
    watched = False

    def __init__(
        self, joint: int | None = None, other_joint: int | None = None, cables: Sequence[Cable] = ()
    ) -> None:
        super().__init__(joint, other_joint)
        self.cables = {cable.key: cable for cable in cables}

    def shapes(self, context: Context) -> Sequence[float]:
        return tuple(self.cables)

    def columns(self, context: Context, shape: float) -> Array:
        return self.torque(context, {"stiffness": 1.0, **_where(self.cables[shape])})[:, :, None]

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        cable = self.cables[shape]
        values = {"stiffness": float(x[0]), **_where(cable)}
        each = iter([*cable.errors, 0.0])
        errors = [[next(each) for _ in range(3)] if p.size == 3 else next(each) for p in self.parameters]
        # of a cable, which does not push, nothing is said of pushing
        return {
            p.name: Estimate(values[p.name], error, p.unit)
            for p, error in zip(self.parameters, errors, strict=True)
            if p.name != "pushes" or cable.pushes
        }

    def of_state(self, arm: Arm, parameters: Values) -> StateLaw:
        k, slack, link = (number(parameters[key]) for key in ("stiffness", "slack_length", "link"))
        both = number(parameters.get("pushes", 0.0))
        a, attached = (_vector(parameters[key]) for key in ("anchor", "attached"))

        def torque(functions: Functions, q: Sequence[Any], v: Sequence[Any]) -> list[Any]:
            def pull(p: Vector) -> Vector:
                d = p[0] - a[0], p[1] - a[1], p[2] - a[2]
                length = functions.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + _NOTHING)
                stretch = length - slack
                along = 0.5 * k * ((1 + both) * stretch + (1 - both) * abs(stretch)) / length
                return along * d[0], along * d[1], along * d[2]

            return point_torques(arm, int(link), attached, pull, functions)(q)

        return torque

    def torque(self, context: Context, parameters: dict[str, Value]) -> Array:
        q, v = context.motion.q, context.motion.v
        tau = self.of_state(context.arm, parameters)(NUMPY, list(q.T), list(v.T))
        return np.stack([np.broadcast_to(x, len(q)) for x in tau], axis=1).astype(float)

    @classmethod
    def fault(cls, parameters: Mapping[str, Any]) -> str:
        link, pushes = number(parameters["link"]), number(parameters.get("pushes", 0.0))
        if link < 1 or link != int(link):
            return f"link is {link:g}; links are counted from 1"
        return "" if pushes in (0, 1) else f"pushes is {pushes:g}; it is 1 of a spring, 0 of a cable"

    def plausible(self, arm: Arm, parameters: dict[str, Estimate]) -> bool:
        return super().plausible(arm, parameters) and number(parameters["link"].value) <= arm.n

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        k, slack, link = (parameters[key] for key in ("stiffness", "slack_length", "link"))
        at, to = (_place(parameters[key]) for key in ("anchor", "attached"))
        error = number(link.std_error)
        which = f"{number(link.value):.0f}" + (f" ± {error:.1f}" if error >= 0.05 else "")
        where = f"link {which} at ({to}) m in its frame"
        if "pushes" in parameters and number(parameters["pushes"].value):
            return (
                f"a spring holds {where} at {slack.words(3)} from ({at}) m in the base frame with {k.words()}: it pulls and "
                "pushes"
            )
        if not number(k.std_error) < _SURE * number(k.value):
            return (
                f"something elastic pulls at link {which}, as a cable, a hose or a spring from the base would; how stiff it "
                f"is and where it runs this run does not tell: {number(k.value):.3g} N/m from ({at}) m in the base frame to "
                f"({to}) m in the link's, slack up to {slack.words(3)}, is one of many that would do"
            )
        return (
            f"an elastic cable, a hose or a spring, pulls {where} towards ({at}) m in the base frame with {k.words()}, once "
            f"it is longer than {slack.words(3)}"
        )


def _where(cable: Cable) -> dict[str, Value]:
    return {
        "slack_length": cable.slack_length,
        "anchor": list(cable.anchor),
        "attached": list(cable.attached),
        "link": float(cable.link),
        "pushes": float(cable.pushes),
    }


def _place(estimate: Estimate) -> str:
    values, errors = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (estimate.value, estimate.std_error))
    errors = np.broadcast_to(errors, values.shape)
    return ", ".join(
        with_error(x, e) if 0 < e < np.inf else f"{x:.3f}" for x, e in zip(values, errors, strict=True)
    )


def _vector(value: Value) -> Vector:
    x, y, z = np.asarray(value, dtype=float).tolist()
    return x, y, z
