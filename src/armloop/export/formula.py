"""Inverse dynamics of a model as traced formulas, with and without the memory of its friction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from armloop.dynamics import ModelEquations
from armloop.export.tracing import Graph, Node
from armloop.laws.effects.base import number
from armloop.laws.effects.listed import EFFECTS
from armloop.laws.friction import FrictionLaw
from armloop.model import AddedEffect, ReconstructedModel
from armloop.robot.arm import Arm

#: Later than any joint has cooled down: what is left of friction that fades.
_LATE = 1e300
_ROUNDING = 4e-16
_MEMORY = ("hysteresis", "load_hysteresis")


class Stop(NamedTuple):
    """One elasto-plastic element: its joint (from 0), the stretch at which it yields, rad (m), and its level there.

    The level is in N·m (N), or per unit of the joint's load.
    """

    joint: int
    width: float
    level: float
    by_load: bool = False


@dataclass(frozen=True, eq=False)
class Formula:
    """Torques as formulas."""

    torque: list[
        Node
    ]  # (n,) as a controller supplies it: friction with memory fully slid, fading friction gone
    remembered: list[
        Node
    ]  # (n,) with the elements' states z[k] in [-1, 1] and the time t of the joints' start
    stops: list[Stop]  # the elements, in the order of their states
    fades: bool  # whether time matters
    left_out: list[str]  # what of the model is not in the formulas, one line each

    @property
    def has_memory(self) -> bool:
        """Whether the two differ."""
        return bool(self.stops) or self.fades


def formula(model: ReconstructedModel) -> Formula:
    """Run a model's equations on traced ``q[j]``, ``v[j]``, ``vdot[j]``, ``z[k]``, ``t``; raises ``ModelError``."""
    n = model.arm.n
    model = replace(model, arm=_exact_quarters(model.arm))
    graph = Graph(n)
    q = [graph.input(f"q[{j}]", j if model.arm.revolute[j] else None) for j in range(n)]
    v = [graph.input(f"v[{j}]") for j in range(n)]
    vdot = [graph.input(f"vdot[{j}]") for j in range(n)]
    plain, left_out = _split(model)

    def torques(kept: ReconstructedModel, t: Node) -> tuple[list[Node], list[Node]]:
        equations = ModelEquations(kept, graph.functions())
        load = equations.load(q, v, vdot)
        tau = [
            graph.node(x) + y
            for x, y in zip(equations.rigid(q, v, vdot), equations.friction(v, load, t, q), strict=True)
        ]
        return tau, [graph.node(x) for x in load]

    late = graph.constant(_LATE)
    torque, _ = torques(plain, late)
    slid, stops = _without_memory(plain)
    fades = any(a.effect.of_time for a in plain.effects)
    if not stops and not fades:
        return Formula(torque, torque, [], False, left_out)
    remembered, load = torques(slid, graph.input("t") if fades else late)
    for k, (joint, _, level, by_load) in enumerate(stops):
        z = level * graph.input(f"z[{k}]")
        remembered[joint] = remembered[joint] + (z * abs(load[joint]) if by_load else z)
    return Formula(torque, remembered, stops, fades, left_out)


def _exact_quarters(arm: Arm) -> Arm:
    """The arm with what is zero but for the rounding of a quarter turn as zero: half of all products go with it."""
    X_PF, axis = arm.X_PF.copy(), arm.axis.copy()
    for values in (X_PF[:, :3, :3], axis):
        values[np.abs(values) < _ROUNDING] = 0.0
    return replace(arm, X_PF=X_PF, axis=axis)


def _split(model: ReconstructedModel) -> tuple[ReconstructedModel, list[str]]:
    """The model without what is no law of its own state, and what was left out."""
    kept, left_out = [], []
    for added in model.effects:
        effect = added.effect
        if effect.sensor:
            left_out.append(f"{effect.label()}: a fault of the record, which no controller supplies")
        elif effect.event:
            left_out.append(f"{effect.label()}: an event of one run")
        elif (
            effect.name not in EFFECTS
            and added.placed() is None
            and effect.of_state(model.arm, added.values) is None
        ):
            left_out.append(f"{effect.label()}: a law in Python, not one that can be written out")
        else:
            kept.append(added)
    return replace(model, effects=tuple(kept)), left_out


def _without_memory(model: ReconstructedModel) -> tuple[ReconstructedModel, list[Stop]]:
    """The model without its elasto-plastic elements, and these."""
    elements: list[Stop] = []
    terms = []
    for j, joint in enumerate(model.friction.terms):
        terms.append(tuple(term for term in joint if term.kind not in _MEMORY))
        elements += [
            Stop(j, float(t.parameter), float(t.coefficient), t.kind == "load_hysteresis")
            for t in joint
            if t.kind in _MEMORY
        ]
    effects = []
    for added in model.effects:
        if added.effect.name != "presliding_hysteresis":
            effects.append(added)
            continue
        assert added.effect.joint is not None
        values = {key: number(e.value) for key, e in added.parameters.items()}
        elements.append(Stop(added.effect.joint - 1, values["width"], values["level"]))
        if values.get("level_change"):
            # what a model that had learned the step has to take back stays a step
            change = replace(added.parameters["level"], value=0.0)
            effects.append(AddedEffect(added.effect, {**added.parameters, "level": change}))
    return replace(model, friction=FrictionLaw(tuple(terms)), effects=tuple(effects)), elements
