"""A reconstructed model: readable terms that predict joint torques, and its file.

A model is the sum of components, each with the step that found it: sparse terms of the double feature set,
a rigid body's inertial parameters, a friction law, and effects that a diagnosis added. Sensor effects change
what a log shows (``predict``), never what a controller supplies (``feedforward``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.data.signals import Conditioning
from armloop.features.rigid_body import full_columns
from armloop.laws.effects import Context, Effect
from armloop.laws.effects.base import Place, fill
from armloop.laws.friction import FrictionLaw
from armloop.model.added_effect import AddedEffect, ripples
from armloop.model.components import COMPONENTS, Component, RigidBody
from armloop.model.formulas import formulas, legend
from armloop.model.pointwise import InverseDynamics, Parts, pointwise, stacked
from armloop.robot.arm import Arm
from armloop.robot.kinematics import nominal_parameters
from armloop.robot.plausibility import require_made_for
from armloop.util.arrays import Array
from armloop.util.errors import ArmError, InputError, ModelError
from armloop.util.files import write_json
from armloop.util.given import numbers_of
from armloop.util.reading import read_json

SCHEMA = "armloop/model/2"
#: Samples whose rigid-body torque is computed at a time: it takes many arrays of them, which are to stay in the cache.
_ROWS = 4096


@dataclass(frozen=True, eq=False)
class ReconstructedModel:
    """Sum of components with friction and effects, made for one arm.

    Attributes:
        arm: the arm it was made for.
        components: rigid-body part, in the order of the steps.
        friction: friction law of all joints.
        conditioning: how the training logs were filtered; later logs are treated alike.
        recorded: how the training logs recorded the torque: ``{"unit": "N*m" | "A", "drive_gains": …}``.
        baseline: what the model leaves on data of its own training runs that were not fitted; where those are
            too short for that, at least what it leaves on all of them:
            ``rmse``, ``rms``, ``nrmse`` per joint, ``worst``, the RMSE that one block in ten exceeds, ``reversals``
            and ``creeping``, the RMSE where a joint turns round and where it creeps, and ``joints``, the parts of the torque
            that are explained, predictable but not explained, and noise.
        effects: laws of the catalogue that a reconstruction found beside the components, and what a diagnosis added.
        history: method, library, steps: how the model came about.
        uncertainty: standard errors of the coefficients (see :func:`armloop.identification.uncertainty.standard_errors`);
            empty where nobody computed them.
    """

    arm: Arm
    components: tuple[Component, ...]
    friction: FrictionLaw
    conditioning: Conditioning = field(default_factory=Conditioning)
    recorded: dict[str, Any] = field(default_factory=lambda: {"unit": "N*m", "drive_gains": None})
    baseline: dict[str, Any] = field(default_factory=dict)
    effects: tuple[AddedEffect, ...] = ()
    history: dict[str, Any] = field(default_factory=dict)
    uncertainty: dict[str, Any] = field(default_factory=dict)

    @property
    def in_amperes(self) -> bool:
        """Whether the model predicts motor currents, for want of gains that make torques of them."""
        return self.recorded["unit"] == "A" and self.recorded["drive_gains"] is None

    @property
    def torque_units(self) -> list[str]:
        """Of what it predicts, joint by joint: "N*m" (revolute), "N" (prismatic) or "A"."""
        return ["A"] * self.arm.n if self.in_amperes else self.arm.torque_units

    @property
    def ranges(self) -> Array:
        """(4, n) how far q, v and v̇ went where the model was fitted, and the middle of q; a guess where it is not kept."""
        n = self.arm.n
        return np.array(self.history.get("range", [[1.0] * n, [1.0] * n, [2.0] * n, [0.0] * n]), dtype=float)

    def rigid_body(self, motion: Motion, step: int = 3) -> Array:
        """(N, n) torque of the components without friction and effects."""
        tau = np.zeros_like(motion.q)
        for start in range(0, motion.samples, _ROWS):
            own = slice(start, start + _ROWS)
            part = motion.take(own)
            for component in self.components:
                tau[own] += component.torque(self.arm, part, step)
        return tau

    def joint_load(self, motion: Motion, step: int = 3) -> Array:
        """(N, n) torque of the components that passes the joints' gears and bearings: all but that of the rotors."""
        return self.rigid_body(motion, step) - self._of_rotors(motion, step)

    def _of_rotors(self, motion: Motion, step: int = 3) -> Array:
        rotors = [
            component.rotors(self.arm.n) for component in self.components if isinstance(component, RigidBody)
        ]
        return np.sum(rotors, axis=0) * motion.vdot if rotors and step >= 3 else np.zeros_like(motion.q)

    def predict(self, motion: Motion, step: int = 3, sensors: bool = True) -> Array:
        """Joint torques for a motion, (N, n) in N·m (N for a prismatic joint).

        Args:
            step: 1 gravity and dry friction, 2 with velocity terms, 3 the whole model with its effects.
            sensors: include what a faulty sensor adds to the record.
        """
        self._check(motion, step)
        if step < 3 or not self.effects:
            rigid = self.rigid_body(motion, step)
            return rigid + self.friction.torque(motion, step, rigid - self._of_rotors(motion, step))
        return self.read(self.context(motion), sensors)

    def read(self, context: Context, sensors: bool = True) -> Array:
        """(N, n) what is recorded of a motion, by the model's context of it: the torque, and what faulty sensors add."""
        tau = context.predicted
        assert tau is not None
        # One fault after the other, each on what the one before has left: first where the encoder says the arm is.
        faults = sorted(
            (a for a in self.effects if sensors and a.effect.sensor), key=lambda a: a.effect.fault_order
        )
        for fault in faults:
            tau = tau + fault.torque(replace(context, predicted=tau))
        return tau

    def of_the_drives(self) -> ReconstructedModel:
        """The model of what the drives supply: without faults of sensors, which the record alone has, and without events.

        Raises:
            InputError: the model predicts currents.
        """
        self.require_torques()
        return replace(self, effects=tuple(self._supplied))

    def require_torques(self, where: str = "the model") -> None:
        """Raise ``InputError`` if the model predicts currents: in them nothing has its physical size."""
        if self.in_amperes:
            raise InputError(
                f"{where} predicts motor currents (A), in which no effect and no limit has its physical size; "
                "reconstruct it with --drive-gains K1,..,KN (N·m/A); what is found is then as exact as they are"
            )

    @property
    def _supplied(self) -> list[AddedEffect]:
        return [added for added in self.effects if not added.effect.sensor and not added.effect.event]

    def _mechanical(self, motion: Motion) -> tuple[Array, Array]:
        """Torque of the arm itself, effects included and sensor faults not, and the load on its joints."""
        rotors = self._of_rotors(motion)
        load = self.rigid_body(motion) - rotors
        effects = [added for added in self.effects if not added.effect.sensor]
        context = self._bare_context(motion, [added.effect for added in effects])
        for added in effects:
            if added.effect.load:
                load = load + added.torque(context)
        context = replace(context, load=load)
        tau = load + rotors + self.friction.torque(motion, 3, load)
        for added in effects:
            if not added.effect.load:
                tau = tau + added.torque(context)
        return tau, load

    def _bare_context(self, motion: Motion, effects: Sequence[Effect]) -> Context:
        inertial = self.carried_parameters() if any(e.needs_inertial for e in effects) else None
        fading, falls = (
            tuple(map(of, range(self.arm.n)))
            for of in (self.friction.fading, self.friction.stribeck_velocity)
        )
        return Context(
            self.arm,
            motion,
            inertial,
            motion.period,
            fading=fading,
            falls=falls,
            ripples=ripples(self.effects),
        )

    def context(self, motion: Motion, needed: Sequence[Effect] | None = None) -> Context:
        """What effects may look at; inertial parameters only where an effect needs them."""
        effects = [added.effect for added in self.effects] if needed is None else needed
        predicted, load = self._mechanical(motion)
        return replace(
            self._bare_context(motion, effects),
            load=load,
            predicted=predicted,
            # effects ask for the motion itself at every step of their search
            predict=lambda other: predicted if other is motion else self._mechanical(other)[0],
        )

    def inertial_parameters(self) -> Array:
        """(10 n,) link parameters that reproduce the model's rigid-body torques beside rotors (:meth:`rotor_inertias`).

        Those of its rigid body, else found by least squares on random motion within the ranges the model was fitted on;
        where the torques do not reveal a parameter, the arm's nominal value stands.
        """
        return self._rigid[0].copy()

    def carried_parameters(self) -> Array:
        """(10 n,) link parameters of all that the arm carries: :meth:`inertial_parameters` and added bodies, a payload's.

        A base that leans turns the weight of them all.
        """
        links = self.inertial_parameters()
        for added in self._supplied:
            body = None if added.effect.needs_inertial else added.effect.body(self.arm, added.values, None)
            if body is not None and body.gravity is None:
                links += body.parameters
        return links

    def rotor_inertias(self) -> Array:
        """(n,) inertias of motors behind gears that reproduce them beside the links, kg·m² (kg)."""
        return self._rigid[1].copy()

    @cached_property
    def _rigid(self) -> tuple[Array, Array]:
        n, rng = self.arm.n, np.random.default_rng(0)
        full, bodies = np.zeros(11 * n), [c for c in self.components if isinstance(c, RigidBody)]
        if bodies and len(bodies) == len(self.components):
            for body in bodies:
                full[: len(body.parameters)] += body.parameters
            return full[: 10 * n], full[10 * n :]
        size = self.ranges
        q, v, vdot = rng.uniform(-1, 1, (3, 400, n)) * size[:3, None]
        part = Motion(np.arange(400.0), q + size[3], v, vdot)
        Y = full_columns(self.arm, part, rotors=True).reshape(-1, 11 * n)
        nominal = np.concatenate([nominal_parameters(self.arm), np.zeros(n)])
        rest = self.rigid_body(part).ravel() - Y @ nominal
        change, turns = np.zeros(11 * n), np.ones(11 * n, dtype=bool)
        while True:
            change[turns] = np.linalg.lstsq(Y[:, turns], rest, rcond=1e-4)[0]
            less = turns & (change < 0) & (np.arange(11 * n) >= 10 * n)
            if not less.any():
                break
            # A motor's inertia takes nothing away from that of its link.
            turns &= ~less
            change[less] = 0.0
        found = nominal + change
        return found[: 10 * n], found[10 * n :]

    def feedforward(
        self, q: Array, v: Array, vdot: Array, step: int = 3, sliding: Array | None = None
    ) -> Array:
        """(n,) torque a controller should supply for one sample; sensor effects excluded.

        Friction with memory acts as if fully slid: a single sample has no history. ``sliding`` (n,) are the
        velocities to take friction at, by default v. Raises ``InputError`` for what is not n finite numbers.
        """
        n = self.arm.n
        slip = None if sliding is None else _of_joints(sliding, n, "sliding")
        return self.drive(step)(
            _of_joints(q, n, "q"), _of_joints(v, n, "v"), _of_joints(vdot, n, "vdot"), slip
        )

    def drive(self, step: int = 3) -> InverseDynamics:
        """The function behind :meth:`feedforward`, for loops in which a look-up counts."""
        if step not in self._pointwise:
            _check_step(step)
            self._pointwise[step] = pointwise(self._parts(step), step)
        return self._pointwise[step]

    def stacked_drive(self, step: int = 3) -> Callable[[Array], Sequence[float]]:
        """The same function of q, v and vdot behind each other in one array (3n,), -> n torques; the fastest there is."""
        _check_step(step)
        return stacked(self._parts(step), step)

    def _parts(self, step: int) -> Parts:
        """What acts at one sample: added effects that are friction of one joint stand with its friction."""
        added = self._supplied if step >= 3 else []
        inertial = self.carried_parameters() if any(a.effect.needs_inertial for a in added) else None
        friction = [[t.acting for t in joint if t.step <= step] for joint in self.friction.terms]
        effects = []
        for a in added:
            law = a.placed()
            if law is None or law.along.ratio or any(t.element.part != "friction" for t in law.terms):
                effects.append((a.effect.load, a.pointwise(self.arm, inertial)))
            else:
                friction[law.along.joint] += law.terms
        return Parts(self.arm, self.components, friction, effects)

    def __getstate__(self) -> dict[str, Any]:
        """All but the functions that were made to be asked quickly: a model goes to other processes as it is."""
        return {key: value for key, value in vars(self).items() if key != "_pointwise"}

    @cached_property
    def _pointwise(self) -> dict[int, InverseDynamics]:
        return {}

    def with_effects(self, added: Sequence[AddedEffect]) -> ReconstructedModel:
        """The model with further effects."""
        return replace(self, effects=(*self.effects, *added))

    def formulas(self) -> list[str]:
        """One readable formula per joint, of all that the arm has: what was found beside the libraries' terms, too."""
        return formulas(self)

    def legend(self) -> list[str]:
        """What symbols in the formulas stand for, an entry each; empty where they speak for themselves."""
        return legend(self)

    def save(self, path: str | Path) -> None:
        """Write the model file (JSON), whole or not at all."""
        write_json(path, self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values with the schema version."""
        return {
            "schema": SCHEMA,
            "formulas": self.formulas(),
            "arm": self.arm.to_dict(),
            "components": [component.to_dict() for component in self.components],
            "friction": self.friction.to_dict(),
            "effects": [added.to_dict() for added in self.effects],
            "conditioning": asdict(self.conditioning),
            "recorded": self.recorded,
            "baseline": self.baseline,
            "history": self.history,
            "uncertainty": self.uncertainty,
        }

    def _check(self, motion: Motion, step: int) -> None:
        if not isinstance(motion, Motion):
            raise ModelError(
                f"predict takes a Motion (armloop.data.motion) of arrays; this is of type {type(motion).__name__}. "
                "For a log: model.compare(log), model.score(log), model.plot(log)"
            )
        _check_step(step)
        if motion.joints != self.arm.n:
            raise ModelError(
                f"the model is of an arm with {self.arm.n} joints, the motion has {motion.joints}"
            )
        if motion.samples == 0:
            raise ModelError("the motion has no samples; give one at least")
        for name in ("q", "v", "vdot"):
            x = getattr(motion, name)
            if not math.isfinite(x.sum()) and not np.isfinite(x).all():
                k, j = (int(i) for i in np.argwhere(~np.isfinite(x))[0])
                raise ModelError(
                    f"{name}{j + 1} of the motion is {x[k, j]} at sample {k}; every number must be finite"
                )


def _check_step(step: int) -> None:
    """Raise ``ModelError`` for a step that no model has."""
    if isinstance(step, bool) or step not in (1, 2, 3):
        raise ModelError(f"step is {step!r}; it must be 1, 2 or 3")


def _of_joints(x: Array, n: int, what: str) -> Array:
    """(n,) finite numbers; an array that is right passes with little more than a look, for loops of control."""
    if type(x) is np.ndarray and x.dtype == np.float64 and x.shape == (n,) and math.isfinite(x.dot(x)):
        return x
    return numbers_of(x, (n,), what)


def load_model(path: str | Path, arm: Arm | None = None) -> ReconstructedModel:
    """Read a model file; with ``arm``, refuse a model made for one that moves otherwise.

    Raises:
        ModelError: unreadable, no JSON, another schema, or a bad field; ``ArmError``: the model is of another arm.
    """
    model = model_of(read_json(path, ModelError, "a model written by `armloop reconstruct`"), str(path))
    if arm is not None:
        require_made_for(model.arm, arm, str(path))
    return model


def model_of(data: Any, where: str) -> ReconstructedModel:
    """The model of a file's content, as of :meth:`ReconstructedModel.to_dict`; ``where`` is named in the errors.

    Raises:
        ModelError, ArmError: as of :func:`load_model`.
    """
    # Here, for a command that only says what it can do should not wait for descriptions of files.
    from armloop.schemas.model_file import model_data

    try:
        return _from_dict(model_data(data))
    except KeyError as error:
        raise ModelError(f"{where}: field {error} is missing") from error
    except (ModelError, ArmError) as error:
        raise type(error)(f"{where}: {error}") from error
    except (TypeError, ValueError, AttributeError, OverflowError, IndexError) as error:
        raise ModelError(f"{where}: a field is misshapen: {error}") from error


def _from_dict(data: dict[str, Any]) -> ReconstructedModel:
    """The model of a file whose fields have been checked one by one; what they mean together is checked here."""
    arm = Arm.from_dict(data["arm"])
    model = ReconstructedModel(
        arm=arm,
        components=tuple(COMPONENTS[item["kind"]].from_dict(item, arm) for item in data["components"]),
        friction=FrictionLaw.from_dict(data["friction"]),
        conditioning=Conditioning(**data["conditioning"]),
        recorded=dict(data["recorded"]),
        baseline=dict(data["baseline"]),
        effects=tuple(AddedEffect.from_dict(item) for item in data["effects"]),
        history=dict(data["history"]),
        uncertainty=_known(data["uncertainty"]),
    )
    had: set[Place] = set()
    for added in model.effects:
        try:
            plausible = added.effect.possible(arm, added.parameters, had)
        except (TypeError, ValueError, OverflowError) as error:
            raise ModelError(f"effect {added.effect.label()}: a parameter is misshapen: {error}") from error
        had.add(added.effect.place)
        if not plausible:
            values = ", ".join(f"{key} {e.value}" for key, e in added.parameters.items())
            raise ModelError(f"effect {added.effect.label()}: {values} cannot be; correct it or leave it out")
        for parameter in added.effect.parameters:
            given = added.parameters.get(parameter.name)
            unit = fill(arm, parameter.unit, added.effect.joint)
            if given is not None and given.unit not in ("", unit):  # one without a unit has the right one
                raise ModelError(
                    f"effect {added.effect.label()}: the unit of {parameter.name} is {given.unit!r:.40}; it must be {unit!r}"
                )
    probe = Motion(np.zeros(1), *np.full((3, 1, arm.n), 0.5))
    with np.errstate(all="ignore"):  # the line below says it
        finite = np.isfinite(model.predict(probe)).all()
    if not finite:
        raise ModelError("a coefficient is not a finite number, or so large that the torque is none")
    return model


def _known(value: Any) -> Any:
    """Null, which stands for a standard error that nobody knows, as the number that is none."""
    if isinstance(value, dict):
        return {k: math.nan if v is None and k in _ERRORS else _known(v) for k, v in value.items()}
    return [_known(each) for each in value] if isinstance(value, list) else value


_ERRORS = {"std_error", "degrees_of_freedom"}
