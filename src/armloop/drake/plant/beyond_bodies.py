"""Joint forces of a model beside its rigid bodies, as a force on a plant: all friction, springs, ripples, tilt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pydrake.systems.framework import LeafSystem_

from armloop.drake.given import require_model
from armloop.drake.plant.friction_system import PreslidingFriction, Stop, presliding_of
from armloop.drake.scalar_types import scalar_template
from armloop.drake.scalars import functions_of, vector
from armloop.dynamics import ModelEquations, viscous_coefficients
from armloop.laws.effects.base import number
from armloop.laws.friction import FrictionLaw
from armloop.model import ReconstructedModel
from armloop.util.errors import InputError
from armloop.util.given import levels_of, require

#: Effects that a description of links and drives holds.
_BODIES = ("payload", "rotor_inertia")


@scalar_template("BeyondBodies_", __name__)
def BeyondBodies_(T: type) -> Any:
    """Return the class for one scalar type."""

    class Impl(LeafSystem_[T]):
        """A model's forces on its arm that a plant of links, rotors and joint damping does not have.

        force = -(friction(v, load(q, v)) - viscous v + springs, ripples, tilt(q, v)) with dry friction's sign as
        tanh(v / `smoothing`), or more slowly where the model's own fades in over a wider range, and of friction that
        grows with the load the load without acceleration.

        Input port: `state` (2n,) positions, then velocities. Output port: `force` (n,), N*m (N), to add to a plant's
        applied generalized forces (`add_joint_forces`). Stateless; the joints are started at time 0. Scalar types
        float, AutoDiffXd and Expression.

        The plant must have the model's links and rotor inertias (payloads included), and its viscous terms as joint
        damping: what `armloop export --to drake` writes (`armloop.dynamics.viscous_coefficients`). An explicit force cannot
        make a joint stick: see `JointFrictionSystem`. Not supported: elasto-plastic elements, which remember
        (`presliding_elements` gives them to `PreslidingFriction`; here they are left out), and the inertia of a
        `transmission_coupling`.
        """

        def _construct(
            self,
            model: ReconstructedModel,
            smoothing: float | Sequence[float] = 0.02,
        ) -> None:
            """model : of n joints; smoothing : rad/s (m/s), of all joints or of each."""
            require_model(model)
            n = self._n = model.arm.n
            widths = per_joint(smoothing, n)
            self.arm = model.arm
            self.damping = viscous_coefficients(model)
            functions = functions_of(T)
            sliding = explicit_part(model)
            self._whole = ModelEquations(sliding, functions, smoothing=widths)
            bodies = tuple(a for a in model.effects if a.effect.name in _BODIES)
            others = [a for a in sliding.effects if not a.effect.sensor and a.effect.name not in _BODIES]
            # Only where an effect acts besides friction are the bodies' torques needed, to take them off again.
            self._bodies = ModelEquations(replace(sliding, effects=bodies), functions) if others else None
            self._state = self.DeclareVectorInputPort("state", 2 * n)
            sources = {self.all_input_ports_ticket(), self.time_ticket()}
            self.DeclareVectorOutputPort("force", n, self._calc_force, sources)

        def _calc_force(self, context: Any, output: Any) -> None:
            n, whole = self._n, self._whole
            state = self._state.Eval(context).tolist()
            q, v, still = state[:n], state[n:], [0.0] * n
            load = whole.load(q, v, still) if whole.load_matters else None
            tau = whole.friction(v, load, context.get_time(), q)
            if self._bodies is not None:
                more = zip(tau, whole.rigid(q, v, still), self._bodies.rigid(q, v, still), strict=True)
                tau = [x + y - z for x, y, z in more]
            output.SetFromVector(vector(T, [-x for x in tau]))

    return Impl


BeyondBodies = BeyondBodies_[None]


def presliding_elements(model: ReconstructedModel) -> list[Stop]:
    """The elasto-plastic elements of a model's friction and of what a diagnosis added; those by load are left out."""
    found = presliding_of(model.friction.terms)
    for added in model.effects:
        if added.effect.name == "presliding_hysteresis" and added.effect.joint is not None:
            level, width = (number(added.parameters[key].value) for key in ("level", "width"))
            found.append(Stop(added.effect.joint, level, width))
    return found


def friction_systems(
    model: ReconstructedModel, smoothing: float | Sequence[float], period: float
) -> list[Any]:
    """The systems that make a plant of a model's bodies the whole model, for `add_joint_forces`."""
    require("a number above 0", period=period)
    systems: list[Any] = [BeyondBodies(model, smoothing)]
    elements = presliding_elements(model)
    return systems + ([PreslidingFriction(model.arm.n, elements, period)] if elements else [])


def per_joint(smoothing: float | Sequence[float], n: int) -> list[float]:
    """The smoothing of each of n joints; raises ``InputError`` unless it is above 0 and one or n numbers."""
    widths: list[float] = levels_of(smoothing, n, "smoothing").tolist()
    if not all(width > 0 for width in widths):
        raise InputError(
            f"smoothing is {smoothing}; it must be above 0 rad/s, one number or one for each of {n} joints"
        )
    return widths


def explicit_part(model: ReconstructedModel) -> ReconstructedModel:
    """The model without viscous terms, which the plant has as damping, and without what remembers."""
    terms = tuple(
        tuple(t for t in joint if t.kind not in ("viscous", "hysteresis")) for joint in model.friction.terms
    )
    effects = []
    for added in model.effects:
        if added.effect.name == "viscous_friction":
            continue
        if added.effect.name == "presliding_hysteresis":
            level = replace(added.parameters["level"], value=0.0)
            added = replace(added, parameters={**added.parameters, "level": level})
        effects.append(added)
    return replace(model, friction=FrictionLaw(terms), effects=tuple(effects))
