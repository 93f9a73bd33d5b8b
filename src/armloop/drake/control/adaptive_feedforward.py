"""Adaptive feedforward: an effect named while the simulation runs is added, and removed again if it does not help."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem, State

from armloop.drake.given import require_of
from armloop.laws.effects.base import Pointwise
from armloop.model import AddedEffect, ReconstructedModel
from armloop.monitoring.blockwise import Known
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.given import levels_of, require

Effects = tuple[AddedEffect, ...]

#: Seconds between two looks at what is named and at the tracking error.
_LOOK = 0.05
#: Seconds between two values of the integrator that are remembered, and how many are.
_REMEMBER, _REMEMBERED = 0.25, 240
#: What is taken must not make the mean tracking error worse than this factor of what it was.
_WORSE = 1.1


@dataclass(frozen=True, eq=False)
class _Taken:
    """Which effects are supplied, which were before, since when the one is blended into the other, and how it goes.

    offset, offset_before : (n,) what is taken off for the integrator; integrals : what it held, every so often
    """

    now: Effects = ()
    before: Effects = ()
    offset: Array | None = None
    offset_before: Array | None = None
    integrals: tuple[tuple[float, Array], ...] = ()
    since: float = -np.inf
    revision: int = 0
    errors: tuple[float, ...] = ()
    without: float = float("nan")
    judge_at: float = np.inf
    settle_at: float = np.inf
    refused: frozenset[object] = frozenset()
    given_back: int = 0


class AdaptiveFeedforward(LeafSystem):
    """Torque of the effects that a `ResidualMonitor` has named, for the reference.

    tau_ff = (1 - a) tau_before + a tau_named,  a = clip((t - t_named) / ramp, 0, 1),  |tau_ff| <= bound,

    each the sum of the effects' torques at q_ref, v_ref, vdot_ref; nothing before the first name. A new revision is
    blended in from the one before. What the controller's integrator has learned of the change meanwhile is taken off
    by the same ramp, as a constant, -(I(t_named) - I(t_change)), so that it need not unwind, and once more after the ramp,
    during which it went on learning. `trial` seconds after the ramp, or at the end of a blend that is under way then, the
    mean absolute tracking error of the last `trial` seconds is compared with that of as many before the first name: where
    it has become more than a tenth worse the effect, and what was taken off for the integrator, is given back by the same
    ramp, and what was named there is not taken again. Faults of sensors are not supplied.

    Input ports: `q_ref`, `v_ref`, `vdot_ref` (n,); `state` (2n,); `named`, abstract, of `ResidualMonitor`;
    `integral` (n,), the torque I that the controller's integrator holds, N*m (N), may be left open. Output ports:
    `tau_ff` (n,), N*m (N), to be added to the model's own feedforward; `given_back` (1,), how often.

    State: abstract, looked at every 0.05 s. Direct feedthrough of the reference. Scalar type float only. Not supported:
    more than one trial: what was added to the first name later is judged with it.
    """

    def __init__(
        self,
        model: ReconstructedModel,
        *,
        ramp: float = 1.0,
        trial: float = 5.0,
        bound: ArrayLike | None = None,
    ) -> None:
        """model : of n joints; ramp, trial : s; bound : (n,) N*m (N), by default half of the drives' effort.

        Raises `InputError` when a time or a bound is not above 0.
        """
        require_of(Arm, **{"the model's arm": getattr(model, "arm", None)})
        require("a number above 0", ramp=ramp, trial=trial)
        super().__init__()
        n = self._n = model.arm.n
        limits = 0.5 * model.arm.effort if bound is None else levels_of(bound, n, "bound")
        if not (trial > _LOOK and (limits > 0).all()):
            raise InputError(f"trial {trial} s must be above {_LOOK} s and bound {limits} above 0")
        self._model, self._ramp, self._trial, self._bound = model, ramp, trial, limits
        # by identity, for parameters cannot be hashed; the effects are kept so that no other takes their place
        self._laws: dict[int, tuple[Effects, list[Pointwise]]] = {}
        self._reference = [self.DeclareVectorInputPort(name, n) for name in ("q_ref", "v_ref", "vdot_ref")]
        self._state = self.DeclareVectorInputPort("state", 2 * n)
        self._named = self.DeclareAbstractInputPort("named", Value(Known()))
        self._integral = self.DeclareVectorInputPort("integral", n)
        self._memory = self.DeclareAbstractState(Value(_Taken()))
        self.DeclarePeriodicUnrestrictedUpdateEvent(_LOOK, _LOOK, self._look)
        kept = {self.abstract_state_ticket(self._memory)}
        sources = {*kept, self.time_ticket(), *(port.ticket() for port in self._reference)}
        self.DeclareVectorOutputPort("tau_ff", n, self._calc_tau_ff, sources)
        self.DeclareVectorOutputPort("given_back", 1, self._calc_given_back, kept)

    @property
    def settling(self) -> float:
        """Seconds from a name until its effects are supplied in full, at most."""
        return self._ramp + _LOOK

    def _taken(self, context: Context) -> _Taken:
        taken = context.get_abstract_state(int(self._memory)).get_value()
        assert isinstance(taken, _Taken)
        return taken

    def _look(self, context: Context, state: State) -> None:
        taken, time = self._taken(context), context.get_time()
        error = float(np.abs(self._reference[0].Eval(context) - self._state.Eval(context)[: self._n]).sum())
        most = round(self._trial / _LOOK)
        taken = replace(taken, errors=(*taken.errors, error)[-most:])
        held = self._integral.Eval(context).copy() if self._integral.HasValue(context) else None
        if held is not None and (not taken.integrals or time - taken.integrals[-1][0] > _REMEMBER - 1e-9):
            taken = replace(taken, integrals=(*taken.integrals, (time, held))[-_REMEMBERED:])
        known = self._named.Eval(context)
        # in the middle of a blend what is supplied is neither of its two ends
        blended = time >= taken.since + self._ramp
        if time >= taken.judge_at and blended:
            taken = replace(taken, judge_at=np.inf)
            if float(np.mean(taken.errors)) > _WORSE * taken.without:
                refused = taken.refused | {added.effect.place for added in taken.now}
                taken = _blended(taken, time, (), None)
                # nothing is left to settle, not even of a later name
                taken = replace(taken, refused=refused, given_back=taken.given_back + 1, settle_at=np.inf)
        elif time >= taken.settle_at:
            # the integrator went on learning during the ramp
            taken = _blended(taken, time, taken.now, _learned(taken, known.since, held))
            taken = replace(taken, settle_at=np.inf)
        elif known.revision > taken.revision and blended:
            effects = tuple(
                added
                for added in known.effects
                if not added.effect.sensor and added.effect.place not in taken.refused
            )
            first = not taken.now and bool(effects)
            learned = _learned(taken, known.since, held) if effects else None
            taken = replace(
                _blended(taken, time, effects, learned),
                revision=known.revision,
                without=float(np.mean(taken.errors)) if first else taken.without,
                judge_at=time + self._ramp + self._trial if first else taken.judge_at,
                settle_at=time + self._ramp if effects else np.inf,
            )
        state.get_mutable_abstract_state(int(self._memory)).set_value(taken)

    def _torque(self, effects: Effects, offset: Array | None, q: Array, v: Array, vdot: Array) -> Array:
        tau = np.zeros(self._n) if offset is None else offset.copy()
        for law in self._law(effects):
            tau += law(q, v, vdot)
        return tau

    def _law(self, effects: Effects) -> list[Pointwise]:
        """The effects' laws for one sample; made once."""
        if id(effects) not in self._laws:
            needed = any(added.effect.needs_inertial for added in effects)
            inertial = self._model.with_effects(effects).carried_parameters() if needed else None
            laws = [added.pointwise(self._model.arm, inertial) for added in effects]
            self._laws[id(effects)] = effects, laws
        return self._laws[id(effects)][1]

    def _calc_tau_ff(self, context: Context, output: BasicVector) -> None:
        taken = self._taken(context)
        if not taken.now and not taken.before:
            output.SetFromVector(np.zeros(self._n))
            return
        reference = [port.Eval(context) for port in self._reference]
        part = min(max((context.get_time() - taken.since) / self._ramp, 0.0), 1.0)
        tau = part * self._torque(taken.now, taken.offset, *reference)
        if part < 1.0:
            tau += (1.0 - part) * self._torque(taken.before, taken.offset_before, *reference)
        output.SetFromVector(np.clip(tau, -self._bound, self._bound))

    def _calc_given_back(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self._taken(context).given_back)])


def _blended(taken: _Taken, time: float, effects: Effects, offset: Array | None) -> _Taken:
    """From now on these effects and this offset, blended in from what there is."""
    return replace(
        taken, now=effects, before=taken.now, offset=offset, offset_before=taken.offset, since=time
    )


def _learned(taken: _Taken, since: float, held: Array | None) -> Array | None:
    """(n,) minus what the integrator has learned since a moment; None where nothing tells."""
    if held is None:
        return None
    before = [value for time, value in taken.integrals if time <= since] or [taken.integrals[0][1]]
    return before[-1] - held
