"""The residual of a model watched while a simulation, or a robot, runs."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, State

from armloop.data.motion import Motion
from armloop.drake.given import require_model
from armloop.model import ReconstructedModel
from armloop.monitoring.blockwise import Known, Watch, advance, block_sums
from armloop.util.errors import InputError
from armloop.util.given import require

#: A joint counts as sliding above this part of the fastest speed that the model was fitted on.
_SLIDES = 0.02


class ResidualMonitor(LeafSystem):
    """Score of each effect that a model may lack, block by block, and the name of what has changed.

    r = tau - model(q, v, vdot);  z = (sum x r - c0 sum x x) / sqrt(sum x x) per column x of the effects' catalogue;
    S = max(0, S + z / z0 - 1.25), and the same for -z: an alarm where S reaches its limit.

    c0 and the largest healthy |z|, z0, are learned in the first `learn` seconds, in which the arm is known to be as it
    should: what the model leaves anyway is no alarm. After an alarm the window's normal equations name the effect
    (`armloop.monitoring.naming`); its parameters are estimated anew whenever the window has doubled.

    Input ports: `tau` (n,) measured torque, N*m (N); `state` (2n,) positions, then velocities; `vdot` (n,) an estimate of
    the acceleration. Output ports: `score` (p,), the cumulative sum of each column as a part of its limit, NaN while
    learning; `alarm` (1,), 1 from the alarm on; `named`, an abstract `Known` with effects and parameters,
    revision 0 until there are any.

    State: the samples of a block (discrete update with `period`) and the watch (abstract, updated once a block, every
    `block` seconds). No direct feedthrough. Scalar type float only. Not supported: more than one change after another
    (what is added to the first is told as part of it), effects with memory, a joint that never slides while learning.
    """

    def __init__(
        self, model: ReconstructedModel, *, period: float = 0.01, block: float = 0.5, learn: float = 20.0
    ) -> None:
        """model : of n joints; period : s between samples; block : s; learn : s at the start, healthy.

        Raises `InputError` when the times do not fit each other.
        """
        require_model(model)
        require("a number above 0", period=period, block=block, learn=learn)
        super().__init__()
        count, blocks = round(block / period), round(learn / block)
        if not (count >= 10 and blocks >= 4):
            raise InputError(
                f"period {period} s, block {block} s, learn {learn} s: a block needs ten samples, learning four blocks"
            )
        n = self._n = model.arm.n
        self._model, self._period, self._count, self._learn = model, period, count, blocks
        self._slides = _SLIDES * model.ranges[1]
        # the columns of any motion are the same: those of one at rest tell how many there are
        rest = np.zeros((count, n))
        motion = Motion(period * np.arange(float(count)), rest, rest + 0.1, rest)
        self._columns, _ = block_sums(model, motion, rest, np.ones((count, n), dtype=bool))
        self._tau = self.DeclareVectorInputPort("tau", n)
        self._state = self.DeclareVectorInputPort("state", 2 * n)
        self._vdot = self.DeclareVectorInputPort("vdot", n)
        self._samples = self.DeclareDiscreteState(count * 4 * n)
        self._watch = self.DeclareAbstractState(Value(Watch()))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._sample)
        self.DeclarePeriodicUnrestrictedUpdateEvent(count * period, count * period, self._advance)
        memory = {self.abstract_state_ticket(self._watch)}
        self.DeclareVectorOutputPort("score", len(self._columns), self._calc_score, memory)
        self.DeclareVectorOutputPort("alarm", 1, self._calc_alarm, memory)
        self.DeclareAbstractOutputPort("named", lambda: Value(Known()), self._calc_named, memory)

    @property
    def columns(self) -> tuple[str, ...]:
        """(p,) what the entries of `score` are of, such as ``viscous_friction:2::0:0.0``."""
        return tuple(column.key for column in self._columns)

    def watch(self, root_context: Context) -> Watch:
        """The watch's state inside a diagram's context, to look at."""
        return self._memory(self.GetMyContextFromRoot(root_context))

    def _memory(self, context: Context) -> Watch:
        watch = context.get_abstract_state(int(self._watch)).get_value()
        assert isinstance(watch, Watch)
        return watch

    def _sample(self, context: Context, discrete: DiscreteValues) -> None:
        row = np.concatenate([self._tau.Eval(context), self._state.Eval(context), self._vdot.Eval(context)])
        index = round(context.get_time() / self._period) % self._count
        samples = discrete.get_mutable_vector(int(self._samples))
        values = samples.CopyToVector()
        values[index * 4 * self._n : (index + 1) * 4 * self._n] = row
        samples.SetFromVector(values)

    def _advance(self, context: Context, state: State) -> None:
        n = self._n
        rows = context.get_discrete_state(int(self._samples)).CopyToVector().reshape(self._count, 4 * n)
        tau, q, v, vdot = (rows[:, k * n : (k + 1) * n] for k in range(4))
        time = context.get_time() + self._period * np.arange(-float(self._count), 0.0)
        slides = np.abs(v) > self._slides
        # what warms up has done so since time 0, not since this block began
        motion = Motion(time, q, v, vdot, np.array([0]), np.array([0.0]))
        _, block = block_sums(self._model, motion, tau, slides)
        following = advance(self._model, self._columns, self._memory(context), block, self._learn)
        state.get_mutable_abstract_state(int(self._watch)).set_value(following)

    def _calc_score(self, context: Context, output: BasicVector) -> None:
        score = self._memory(context).score
        output.SetFromVector(np.full(len(self._columns), np.nan) if score is None else score)

    def _calc_alarm(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self._memory(context).alarmed > 0)])

    def _calc_named(self, context: Context, output: Value) -> None:
        output.set_value(self._memory(context).known)
