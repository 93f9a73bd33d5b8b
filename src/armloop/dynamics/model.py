"""A reconstructed model as equations of motion: M(q), bias, gravity and friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from armloop.dynamics.effects import effect_law
from armloop.dynamics.equations import (
    EnergyEquations,
    Equations,
    Numbers,
    RotorEquations,
    Rows,
    of_bodies,
)
from armloop.dynamics.sparse import SparseArrayEquations, SparseEquations
from armloop.laws.friction import Acting, Direction, Sliding, torque_along
from armloop.model import ReconstructedModel
from armloop.model.components import Component, Lagrangian, RigidBody, SparseTerms
from armloop.robot.arm import Arm
from armloop.util.errors import ModelError
from armloop.util.functions import NUMPY, Functions

_LOAD_ROUNDS = 3


class ModelEquations:
    """tau = M(q) vdot + bias(q, v) + gravity(q) + friction(v), for any kind of number.

    tau is what the drives supply. A payload, a rotor's inertia, a spring, a ripple and a tilted base, where a
    diagnosis added them, are in M, bias and gravity (all that depends on position alone); friction effects are
    in friction. What a sensor adds to the record is left out.

    Friction with memory acts as if fully slid. Friction that grows with the load takes the torque of all but
    friction as the load.

    Vectors are sequences of n numbers, matrices lists of n rows; the numbers may be floats, arrays of samples,
    AutoDiffXd or symbolic Expressions, with `functions` to match.
    """

    def __init__(
        self,
        model: ReconstructedModel,
        functions: Functions,
        *,
        step: int = 3,
        smoothing: float | Sequence[float] = 0.0,
        sharp: bool = False,
        symmetric: bool = False,
    ) -> None:
        """Take a model.

        Args:
            step: what of it: 1 gravity and dry friction, 2 with velocity terms, 3 the whole with its effects.
            smoothing: speed, rad/s or m/s, within which dry friction changes sign as tanh(v / smoothing), of all
                joints or of each, or more slowly where the model's own fades in over a wider range; 0 for the sign
                itself, which has no derivative at rest.
            sharp: take smoothed dry friction of the model, tanh(v / p), as sign(v), for a plant that sticks.
            symmetric: take (M + M^T) / 2 for M. The mass matrix of sparse terms is not symmetric by itself.

        Raises:
            ModelError: an added effect has no law of q, v and vdot.
        """
        self.n = model.arm.n
        self.step = step
        self.symmetric = symmetric
        self.functions = functions
        # A fault of a sensor is none of the arm, an event of one run none of the next.
        kept = [a for a in model.effects if step >= 3 and not a.effect.sensor and not a.effect.event]
        inertial = model.carried_parameters() if any(a.effect.needs_inertial for a in kept) else None
        laws = []
        for a in kept:
            name, joint, other = a.effect.place
            laws.append(effect_law(model.arm, name, joint, a.values, functions, inertial, other))
        used = [c for c in model.components if not isinstance(c, SparseTerms) or c.step <= step]
        self._parts: list[tuple[Equations, bool]] = [
            (part, not isinstance(part, RotorEquations)) for part in equations(model.arm, used, functions)
        ]
        self._parts += [(law.equations, law.load) for law in laws if law.equations is not None]
        #: What rubs, along every joint and every direction that two share.
        self._friction: dict[Direction, list[Acting]] = {
            Direction(j): [t.acting for t in joint if t.step <= step]
            for j, joint in enumerate(model.friction.terms)
        }
        for law in laws:
            if law.friction is not None:
                self._friction.setdefault(law.friction.along, []).extend(law.friction.terms)
        self._sharp = sharp
        each = [float(smoothing)] * self.n if isinstance(smoothing, int | float) else [*map(float, smoothing)]
        #: The smoothing along each direction: of two joints that share it no less than either's part of the sliding.
        self._smoothing = {
            along: each[along.joint] + (abs(along.ratio) * each[along.other] if along.ratio else 0.0)
            for along in self._friction
        }
        for along, terms in self._friction.items():
            terms[:] = [t.widened(self._smoothing[along]) for t in terms]
        rubbing = [t.element for terms in self._friction.values() for t in terms]
        self.load_matters = any(element.by_load for element in rubbing)

    def mass_matrix(self, q: Numbers) -> Rows:
        """The n rows of M(q), kg m² (kg, kg m).

        Raises ``ModelError`` where a term is not linear in the acceleration alone.
        """
        if self.step < 3:
            raise ModelError(f"the terms up to step {self.step} hold no inertia; take step 3")
        return self._inertia(q)

    def gravity(self, q: Numbers) -> list[Any]:
        """The n torques that hold the arm still at q, friction apart."""
        return self._rest(q, [0.0] * self.n)

    def bias(self, q: Numbers, v: Numbers) -> list[Any]:
        """The n torques C(q, v) v of the motion at constant velocities."""
        return [x - y for x, y in zip(self._rest(q, v), self.gravity(q), strict=True)]

    def rigid(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        """M(q) vdot + bias(q, v) + gravity(q). Needs no mass matrix, so that every model has it."""
        return self._torque(q, v, vdot, loads_only=False)

    def load(self, q: Numbers, v: Numbers, vdot: Numbers) -> list[Any]:
        """The n torques that load the joints, which friction may grow with."""
        return self._torque(q, v, vdot, loads_only=True)

    def friction(
        self,
        v: Numbers,
        load: Sequence[Any] | None = None,
        t: Any = math.inf,
        q: Numbers | None = None,
    ) -> list[Any]:
        """The n friction torques at velocities v; at rest, where they are not determined, 0.

        Args:
            load: n torques, for friction that grows with them; 0 by default.
            t: time since the start, s, for friction that changes with it; by default that of a warm joint.
            q: n positions, for friction that changes with them.

        Raises:
            ModelError: friction changes with the positions, and there are none.
        """
        if q is None and any(
            acting.element.of_position for terms in self._friction.values() for acting in terms
        ):
            raise ModelError("the model's friction changes with the position of a joint; give q as well")
        f, total = self.functions, [0.0] * self.n
        loads = [0.0] * self.n if load is None else load
        for along, terms in self._friction.items():
            w = along.of(v)
            width = self._smoothing[along]
            sign = f.tanh(w / width) if width else f.sign(w)
            x = Sliding(0.0 if q is None else along.of(q), w, sign, t)
            along.add(total, torque_along(terms, x, loads[along.joint], f, self._sharp))
        return total

    def dry_and_smooth(
        self, q: Numbers, v: Numbers, load: Sequence[Any] | None = None, t: Any = math.inf
    ) -> list[tuple[Direction, Any, Any]]:
        """Along each direction: the level of dry friction, which has the sign of the sliding, and what else rubs."""
        loads, found = [0.0] * self.n if load is None else load, []
        for along, terms in self._friction.items():
            forward, backward = (
                torque_along(
                    terms,
                    Sliding(along.of(q), along.of(v), sign, t),
                    loads[along.joint],
                    self.functions,
                    self._sharp,
                )
                for sign in (1.0, -1.0)
            )
            found.append((along, 0.5 * (forward - backward), 0.5 * (forward + backward)))
        return found

    def torque(self, q: Numbers, v: Numbers, vdot: Numbers, t: Any = math.inf) -> list[Any]:
        """Inverse dynamics: the n torques of the drives."""
        rigid = self.rigid(q, v, vdot)
        load = self.load(q, v, vdot) if self.load_matters else None
        return [x + y for x, y in zip(rigid, self.friction(v, load, t, q), strict=True)]

    def acceleration(self, q: Numbers, v: Numbers, tau: Numbers, t: Any = math.inf) -> list[Any]:
        """Forward dynamics: vdot of M(q) vdot = tau - bias(q, v) - gravity(q) - friction(v).

        Friction that grows with the load depends on vdot in turn, c |M vdot + rest|. Where the loads' signs are
        known it is linear in vdot; they are taken from the solution before, three times.

        M must have a positive definite symmetric part (see :func:`armloop.dynamics.require_mass_matrix`).
        """
        M, joints = self.mass_matrix(q), range(self.n)
        friction = self.friction(v, None, t, q)
        drive = [x - y - z for x, y, z in zip(tau, self._rest(q, v), friction, strict=True)]
        vdot = solve(M, drive)
        if not self.load_matters:
            return vdot
        slopes = [x - y for x, y in zip(self.friction(v, [1.0] * self.n, t, q), friction, strict=True)]
        load_M, load_rest = self._inertia(q, loads_only=True), self._rest(q, v, loads_only=True)
        for _ in range(_LOAD_ROUNDS):
            loads = [
                sum((m * a for m, a in zip(row, vdot, strict=True)), x)
                for row, x in zip(load_M, load_rest, strict=True)
            ]
            signed = [slope * self.functions.sign(x) for slope, x in zip(slopes, loads, strict=True)]
            A = [[M[i][j] + signed[i] * load_M[i][j] for j in joints] for i in joints]
            vdot = solve(A, [drive[i] - signed[i] * load_rest[i] for i in joints])
        return vdot

    def _inertia(self, q: Numbers, loads_only: bool = False) -> Rows:
        M: Rows = [[0.0] * self.n for _ in range(self.n)]
        for part, is_load in self._parts:
            if is_load or not loads_only:
                M = [
                    [x + y for x, y in zip(a, b, strict=True)]
                    for a, b in zip(M, part.inertia(q), strict=True)
                ]
        if self.symmetric:
            n = range(self.n)
            M = [[M[i][j] if i == j else 0.5 * (M[i][j] + M[j][i]) for j in n] for i in n]
        return M

    def _rest(self, q: Numbers, v: Numbers, loads_only: bool = False) -> list[Any]:
        tau: list[Any] = [0.0] * self.n
        for part, is_load in self._parts:
            if is_load or not loads_only:
                tau = [x + y for x, y in zip(tau, part.rest(q, v), strict=True)]
        return tau

    def _torque(self, q: Numbers, v: Numbers, vdot: Numbers, loads_only: bool) -> list[Any]:
        still: Numbers = [0.0] * self.n
        v, vdot = v if self.step >= 2 else still, vdot if self.step >= 3 else still
        tau: list[Any] = [0.0] * self.n
        for part, is_load in self._parts:
            if is_load or not loads_only:
                tau = [x + y for x, y in zip(tau, part.torque(q, v, vdot), strict=True)]
        return tau


def solve(A: Rows, b: Sequence[Any]) -> list[Any]:
    """The solution of A x = b for any kind of number, by elimination in the given order.

    Without a choice of pivots, since symbols cannot be compared: for a matrix with a positive definite symmetric
    part all pivots are positive.
    """
    n = len(b)
    A, x = [list(row) for row in A], list(b)
    for k, row in enumerate(A):
        pivot, value = row[k], x[k]
        for i in range(k + 1, n):
            below = A[i]
            factor = below[k] / pivot
            for j in range(k + 1, n):
                below[j] = below[j] - factor * row[j]
            x[i] = x[i] - factor * value
    for k in range(n - 1, -1, -1):
        row, value = A[k], x[k]
        for j in range(k + 1, n):
            value = value - row[j] * x[j]
        x[k] = value / row[k]
    return x


def equations(arm: Arm, components: Sequence[Component], functions: Functions) -> list[Equations]:
    """The equations of a model's components; sparse terms of all steps together, since they share their waves."""
    sparse = [c for c in components if isinstance(c, SparseTerms) and len(c.index)]
    kind = SparseArrayEquations if functions is NUMPY else SparseEquations
    parts: list[Equations] = [kind(sparse, functions)] if sparse else []
    for component in components:
        if isinstance(component, Lagrangian):
            parts.append(EnergyEquations(component, functions))
        elif isinstance(component, RigidBody):
            parts += of_bodies(arm, component, functions)
        elif not isinstance(component, SparseTerms):
            raise TypeError(f"{type(component).__name__} has no equations of motion")
    return parts
