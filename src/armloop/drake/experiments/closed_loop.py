"""An arm under control, added to any diagram in one call: plant with friction, reference, model, controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, System

from armloop.drake.control.computed_torque import AccelerationGains, ComputedTorque
from armloop.drake.control.feedforward import FeedforwardModel
from armloop.drake.control.pid import PidController, PidGains
from armloop.drake.control.rate_limiter import RateLimiter
from armloop.drake.control.reference import ReferenceLike, ReferenceSource, as_reference
from armloop.drake.experiments.scenarios import Plant, built_in, plant_for
from armloop.drake.given import require_of, require_predicts, require_step
from armloop.drake.plant.fault_injection import Effects, realise
from armloop.drake.plant.nearest_friction import nearest_friction
from armloop.drake.plant.plant import ArmPlant
from armloop.experiment.excitation import Reference
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm
from armloop.robot.levelling import say_other_stance
from armloop.util.errors import InputError

CONTROLLERS = ("pid", "computed_torque")
"""The controllers that `add_arm_with_controller` knows; `add_arm_under` takes a law of your own."""
_REFERENCE = ("q_ref", "v_ref", "vdot_ref", "tau_ff")


@dataclass(frozen=True, eq=False)
class ControlledArm:
    """The systems that `add_arm_with_controller` added, to connect more to, or to log.

    plant : output ports `state` (2n,), `tau_drive` (n,)
    reference : `q_ref`, `v_ref`, `vdot_ref`, `tau_ff` (n,); `tau_ff` is zero without a model or where the
        controller holds the model itself
    controller : `tau` (n,)
    drives : where torques can change at a limited rate only, between the controller and the plant: `tau` (n,)
    followed : the motion behind `reference`
    """

    plant: ArmPlant
    reference: ReferenceSource
    controller: PidController | LeafSystem
    drives: RateLimiter | None = None
    followed: Reference | None = None

    def start_on_reference(self, root_context: Context) -> None:
        """Put the arm where the reference begins, at its velocity, inside the diagram's context."""
        q_ref, v_ref, _ = self.reference.tables
        self.plant.set_state(root_context, q_ref[0], v_ref[0])
        if self.drives is not None:
            # it was held there
            held = self.drives.GetMyMutableContextFromRoot(root_context)
            law, effort = self.controller, self.plant.arm.effort
            asked = law.GetOutputPort("tau").Eval(law.GetMyContextFromRoot(root_context))
            self.drives.set_torque(held, np.clip(asked, -effort, effort))

    def set_model(self, model: Any, step: int = 3) -> None:
        """Exchange the model in a running simulation, between two calls of `Simulator.AdvanceTo`.

        step : how much of it is fed forward (`tau_ff`); a law that holds the model, as computed torque, takes the whole

        Raises `InputError` where the control law takes none.
        """
        require_step(step)
        fed, held = self.controller.HasInputPort("tau_ff"), getattr(self.controller, "set_model", None)
        if not fed and held is None:
            raise InputError(
                f"{self.controller.get_name()}: takes no model; a control law that does has the port tau_ff or a set_model"
            )
        if isinstance(model, ReconstructedModel):
            model.arm.require_same(self.plant.arm, "the model")
            say_other_stance(self.plant.arm, self.plant.effects.gravity(self.plant.arm), model.arm)
        if fed:
            self.reference.set_model(model, step)
        if held is not None:
            held(model)


def add_arm_with_controller(
    builder: DiagramBuilder,
    arm: str | Path | Arm | Plant,
    gains: PidGains | AccelerationGains,
    reference: ReferenceLike,
    model: FeedforwardModel | None = None,
    step: int = 3,
    *,
    controller: str = "pid",
    effects: Effects = (),
    torque_rate: ArrayLike | None = None,
) -> ControlledArm:
    """Add an arm that follows a reference: a plant with sticking friction under the controller of your choice.

    `"pid"`: Eqs. (35), (36), or PID alone without a model. `ReferenceSource` (with the model's feedforward) ->
    `PidController` -> `ArmPlant` in torque mode -> back.
    `"computed_torque"`: `ReferenceSource` -> `ComputedTorque` -> `ArmPlant` -> back; it needs a model that
    predicts at velocities of the caller's choice, such as one of `armloop.model.load_model`.

    The systems are named as the arm, `reference` and as the controller (`drives`, with a `torque_rate`). Where one of these
    names is taken, as by an arm that was added before, all have the same number behind them: `reference_2`, `pid_2`.

    The arm starts at its zero position, unless `ControlledArm.start_on_reference` or `ArmPlant.set_state` is called.

    arm : a plant of `scenarios.load_plant`; a built-in name, then its plant; or the path of a URDF, or an arm of
        `load_arm` (with `lock` or `tip` where it has a gripper), then with the friction of a reconstructed `model`
        (`nearest_friction`), without one that of `scenarios.plant_for`
    reference : of `armloop.experiment.excitation`, or a Drake trajectory of n rows, such as a `PiecewisePolynomial`
    gains : of the arm's n joints, `PidGains.paper(n)` or `AccelerationGains.critical(n)` for instance
    model : by its terms up to `step` (1, 2 or 3) for `"pid"`
    effects : what the plant has and the model may not know
    torque_rate : (n,) N*m/s (N/s), how fast the drives can change their torques (`RateLimiter`); any by default

    Raises `ArmError` for an arm that cannot be simulated, `InputError` when gains, reference, model and controller do
    not fit each other.
    """
    require_of(DiagramBuilder, builder=builder)
    spec = arm if isinstance(arm, Plant) else _plant(arm, model)
    n, config, period = spec.arm.n, spec.config, spec.config.time_step
    _check_controller(controller, gains, model, step)
    if isinstance(model, ReconstructedModel):
        model.arm.require_same(spec.arm, "the model")
        say_other_stance(spec.arm, realise(spec.arm, effects).gravity(spec.arm), model.arm)
    reference = as_reference(reference)
    followed = reference.evaluate([0.0])[0].shape[1]
    if not len(gains.kp) == followed == n:
        raise InputError(
            f"{spec.arm.name} has {n} joints; the gains are for {len(gains.kp)}, the reference for {followed}"
        )
    law: LeafSystem
    if isinstance(gains, PidGains):
        law = PidController(gains, period, config.instruments.resolution(spec.arm))
    else:
        law = ComputedTorque(model, gains, period=period)
    return add_arm_under(
        builder,
        spec,
        law,
        reference,
        model,
        step,
        name=controller,
        effects=effects,
        torque_rate=torque_rate,
    )


def add_arm_under(
    builder: DiagramBuilder,
    plant: Plant,
    law: LeafSystem,
    reference: ReferenceLike,
    model: FeedforwardModel | None = None,
    step: int = 3,
    *,
    name: str = "controller",
    effects: Effects = (),
    torque_rate: ArrayLike | None = None,
) -> ControlledArm:
    """Add a plant that follows a reference under a control law of the caller's own; else as `add_arm_with_controller`.

    law : input ports `state` and those that it wants of `q_ref`, `v_ref`, `vdot_ref` and, with a `model`, `tau_ff`;
        output port `tau` (n,)

    Raises `InputError` when the law lacks a port, or has another one, or one of other joints.
    """
    require_of(DiagramBuilder, builder=builder)
    require_of(Plant, plant=plant)
    require_of(System, law=law)
    config, period = plant.config, plant.config.time_step
    ports = [law.get_input_port(k).get_name() for k in range(law.num_input_ports())]
    wanted = [port for port in ports if port in _REFERENCE]
    if not law.HasOutputPort("tau") or "state" not in ports or len(wanted) + 1 < len(ports):
        raise InputError(
            f"{name}: has the input ports {', '.join(ports) or 'none'}; a control law has state, those that it wants of "
            f"{', '.join(_REFERENCE)}, and the output port tau"
        )
    reference, n = as_reference(reference), plant.arm.n
    sizes = {port: law.GetInputPort(port).size() for port in ports} | {"tau": law.GetOutputPort("tau").size()}
    for port, size in sizes.items():
        if size != (2 * n if port == "state" else n):
            raise InputError(f"{name}: its port {port} has {size} entries, {plant.arm.name} has {n} joints")
    if isinstance(law, PidController) and law.period != period:
        raise InputError(
            f"{name}: has a period of {law.period:g} s, the plant {period:g} s; give both the same"
        )
    source = ReferenceSource(reference, period, model if "tau_ff" in wanted else None, step)
    body = ArmPlant(plant.arm, config.friction, effects=config.with_rotors(effects), time_step=period)
    suffix = _suffix(builder, [body.get_name(), "reference", name, "drives"])
    builder.AddNamedSystem(body.get_name() + suffix, body)
    builder.AddNamedSystem(f"reference{suffix}", source)
    builder.AddNamedSystem(f"{name}{suffix}", law)
    for port in wanted:
        builder.Connect(source.GetOutputPort(port), law.GetInputPort(port))
    builder.Connect(body.GetOutputPort("state"), law.GetInputPort("state"))
    drives = law
    if torque_rate is not None:
        limiter = RateLimiter(plant.arm.effort, torque_rate, period)
        drives = builder.AddNamedSystem(f"drives{suffix}", limiter)
        builder.Connect(law.GetOutputPort("tau"), drives.GetInputPort("u"))
    builder.Connect(drives.GetOutputPort("tau"), body.GetInputPort("tau"))
    return ControlledArm(body, source, law, drives if drives is not law else None, reference)


def _suffix(builder: DiagramBuilder, names: Sequence[str]) -> str:
    """What makes all names new to the diagram, whose building ends the process where two are the same."""
    suffixes = ("", *(f"_{k}" for k in range(2, len(builder.GetSystems()) + 3)))
    return next(s for s in suffixes if not any(builder.HasSubsystemNamed(name + s) for name in names))


def _plant(spec: str | Path | Arm, model: FeedforwardModel | None) -> Plant:
    """The plant of an arm; one of a URDF, in which what sticks has no place, has the friction of its model."""
    if built_in(spec) or not isinstance(model, ReconstructedModel):
        return plant_for(spec)
    return plant_for(spec, nearest_friction(model))


def _check_controller(
    controller: str, gains: PidGains | AccelerationGains, model: FeedforwardModel | None, step: int
) -> None:
    if not isinstance(controller, str) or controller not in CONTROLLERS:
        raise InputError(f"controller is {controller!r:.60}; there are: {', '.join(CONTROLLERS)}")
    require_step(step)
    if model is not None:
        require_predicts(model)
    wanted = PidGains if controller == "pid" else AccelerationGains
    if not isinstance(gains, wanted):
        raise InputError(f"{controller} takes {wanted.__name__}; the gains are {type(gains).__name__}")
    if controller == "computed_torque" and (model is None or step != 3):
        raise InputError("computed_torque needs a model, and all three steps of it")
