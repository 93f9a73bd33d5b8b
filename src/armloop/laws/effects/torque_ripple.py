"""Torque ripple: what repeats with the joint's angle, by cogging or gear mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from armloop.data.motion import Motion
from armloop.laws.effects.base import Array, Context, Estimate, Parameter, Values, number
from armloop.laws.effects.law import Law
from armloop.laws.friction import Element
from armloop.robot.arm import Arm
from armloop.util.arrays import TINY


class TorqueRipple(Law):
    """tau_j += A sin(N q_j + φ), with N cycles per revolution: of teeth a whole number, behind a gear any."""

    name = "torque_ripple"
    periodic = True
    parameters = (
        Parameter("amplitude", "TAU"),
        Parameter("order", "1/rev", shape="chosen"),
        Parameter("phase", "rad"),
    )
    law = "A sin(N q + phi)"
    elements = (
        Element(lambda x, p, f: f.sin(p * x.q), "sin({p:g}*q{j})", part="position"),
        Element(lambda x, p, f: f.cos(p * x.q), "cos({p:g}*q{j})", part="position"),
    )

    #: Low orders belong to gravity, whose harmonics of the angle are 1 to 3.
    lowest_order = 4
    #: Above this part of the sample rate a ripple has been filtered away.
    band = 0.2
    #: Periods between two samples up to which a ripple is as it is, and from which on samples show nothing of it: in between
    #: it would be there as one of another frequency, which no low-pass takes away.
    sampled = 0.3, 0.6
    #: Samples follow one another if they lie no farther from where their speed leads, in parts of the way.
    follow = 0.2
    #: Orders that differ by 2π over the travel are one; between whole ones it is sought in such parts of that.
    part = 0.05

    def coefficients(self, p: Mapping[str, float]) -> tuple[float, ...]:
        return p["amplitude"] * float(np.cos(p["phase"])), p["amplitude"] * float(np.sin(p["phase"]))

    def values(self, context: Context, shape: float) -> list[Array]:
        """Sine and cosine, but where samples follow one another too far apart for them."""
        shown = self._shown(context.motion, shape)
        return [shown * column for column in super().values(context, shape)]

    def _shown(self, motion: Motion, order: float) -> Array | float:
        """(N,) the part of a ripple that samples show of it; states that do not follow one another are as they are."""
        if motion.samples < 2:
            return 1.0
        steps = motion.v[:, self.index] * motion.period
        apart = np.abs(np.gradient(motion.q[:, self.index]) - steps)
        if apart.sum() > self.follow * np.abs(steps).sum():
            return 1.0
        periods, (whole, none) = order * np.abs(steps) / (2 * np.pi), self.sampled
        return np.clip((none - periods) / (none - whole), 0.0, 1.0)

    def columns(self, context: Context, shape: float) -> Array:
        """Sine and cosine; of an order that is none of teeth also what a small change of it does to either."""
        own = super().columns(context, shape)
        if float(shape).is_integer():
            return own
        return np.hstack([own, context.motion.q[:, [self.index]] * own[:, ::-1] * [1.0, -1.0]])

    def fixed_columns(self, context: Context, shape: float) -> Array:
        return self.on_all_joints(super().columns(context, shape), context.arm.n)

    def start(self, beta: Array) -> Array:
        if len(beta) == len(self.elements):
            return beta
        return np.append(beta[:2], beta[:2] @ beta[2:] / (beta[:2] @ beta[:2] + TINY))

    def embed(self, x: Array) -> tuple[Array, Array]:
        """Coefficients a, b and, with a change d of the order, a d and b d."""
        if len(x) == len(self.elements):
            return super().embed(x)
        J = np.vstack([np.eye(2, 3), np.column_stack([x[2] * np.eye(2), x[:2]])])
        return np.append(x[:2], x[2] * x[:2]), J

    def named(self, x: Array, shape: float) -> tuple[float, ...]:
        return float(np.hypot(*x[:2])), shape + float(x[2:].sum()), float(np.arctan2(x[1], x[0]))

    def estimates(self, arm: Arm, x: Array, covariance: Array, shape: float) -> dict[str, Estimate]:
        found = super().estimates(arm, x, covariance, shape)
        if len(x) == len(self.elements) and not float(shape).is_integer():
            # nobody knows by how much the order is off, nor the phase, which is taken at q = 0
            found |= {key: replace(found[key], std_error=np.nan) for key in ("order", "phase")}
        return found

    def refined(self, x: Array, shape: float) -> float:
        return shape + float(np.clip(x[2:].sum(), -0.5, 0.5))

    def shapes(self, context: Context) -> Sequence[float]:
        if context.arm.joints[self.index].kind != "revolute":
            return ()
        speed = float(np.quantile(np.abs(context.motion.v[:, self.index]), 0.7))
        top = 2 * np.pi * self.band / context.period / max(speed, 1e-3)
        orders = range(self.lowest_order, int(min(max(top, 24), 240)) + 1)
        # one that the model has may have grown, however little of it a filter leaves where the joint is fast
        known = (float(order) for order in context.ripples.get(self.index + 1, ()))
        return sorted({*map(float, orders), *(order for order in known if order.is_integer())})

    def between(self, context: Context, shape: float) -> Sequence[float]:
        step = self.part * 2 * np.pi / max(float(np.ptp(context.motion.q[:, self.index])), TINY)
        beside = np.arange(step, 1.0, max(step, self.part))
        return [float(order) for order in np.concatenate([shape - beside[::-1], shape + beside])]

    def order(self, parameters: Values) -> float:
        return number(parameters["order"])

    def sentence(self, parameters: dict[str, Estimate]) -> str:
        a, order, phase = (parameters[key] for key in ("amplitude", "order", "phase"))
        return (
            f"the torque of joint {self.joint} ripples {number(order.value):.4g} times per revolution with amplitude "
            f"{a.words()} and phase {number(phase.value):.2f} rad"
        )
