"""The parts a model's rigid-body torque is made of; each predicts, prints its terms, and keeps itself as JSON."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np

from armloop.data.motion import Motion
from armloop.features.double_feature_set import Factors, padded, product_name, products
from armloop.features.lagrangian import EnergyTerms
from armloop.features.rigid_body import parameter_names, rotor_names
from armloop.robot.arm import Arm
from armloop.robot.newton_euler import joint_torques
from armloop.util.arrays import Array, Index
from armloop.util.errors import ModelError

Term = tuple[int, float, str]


class Component(Protocol):
    """What every part of a model can do."""

    kind: ClassVar[str]

    def torque(self, arm: Arm, motion: Motion, step: int) -> Array:
        """(N, n) torque of what was found up to ``step``."""

    def terms(self, arm: Arm, joint: int) -> list[Term]:
        """(step, coefficient, name) of every term of one joint (0-based)."""

    def legend(self) -> list[str]:
        """What symbols in the terms stand for, one line each."""

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""

    @staticmethod
    def from_dict(data: dict[str, Any], arm: Arm) -> Component:
        """Rebuild from :meth:`to_dict`, the content of a file as `armloop.schemas.model` checks it."""


_LEGEND = (
    "Yj[p] is the torque of joint j per unit of a base parameter p. These are sums, in SI units, of the links' masses m,\n"
    "  first moments mx, my, mz = mass times centre, inertias Ixx .. Iyz about the link's origin, and rotor inertias J:"
)


@dataclass(frozen=True, eq=False)
class SparseTerms:
    """Terms of the double feature set, or of its angle sums, found in one step.

    Attributes:
        step: 1, 2 or 3; 3 for one-shot SINDy.
        index: (T, K) factor indices of the terms (see :class:`Factors`).
        coefficients: (T, n), zero where a joint does not use a term.
        waves: the wave vectors of the factors; none for the paper's sin qᵢ and cos qᵢ.
    """

    step: int
    index: Index
    coefficients: Array
    waves: tuple[tuple[int, ...], ...] = ()
    kind: ClassVar[str] = "terms"

    @cached_property
    def factors(self) -> Factors:
        """The elementary functions that the index refers to."""
        return Factors(self.coefficients.shape[1], self.waves)

    @cached_property
    def _names(self) -> list[str]:
        return [product_name(row, self.factors.names) for row in self.index]

    def torque(self, arm: Arm, motion: Motion, step: int) -> Array:
        if step < self.step or len(self.index) == 0:
            return np.zeros_like(motion.q)
        return products(self.factors.evaluate(motion), self.index) @ self.coefficients

    def terms(self, arm: Arm, joint: int) -> list[Term]:
        c = self.coefficients[:, joint]
        return [(self.step, float(c[t]), self._names[t]) for t in np.flatnonzero(c)]

    def legend(self) -> list[str]:
        return []

    def to_dict(self) -> dict[str, Any]:
        joints = [{self._names[t]: float(c[t]) for t in np.flatnonzero(c)} for c in self.coefficients.T]
        return {"kind": self.kind, "step": self.step, "joints": joints}

    @staticmethod
    def from_dict(data: dict[str, Any], arm: Arm) -> SparseTerms:
        joints = data["joints"]
        names = list(dict.fromkeys(name for joint in joints for name in joint))
        waves = _waves_in(names, arm.n)
        factors = Factors(arm.n, waves)
        known = {factor: e for e, factor in enumerate(factors.names)}
        index = padded([_parse_product(name, known, arm.n) for name in names])
        coefficients = np.array([[float(joint.get(name, 0.0)) for joint in joints] for name in names])
        return SparseTerms(int(data["step"]), index, coefficients.reshape(-1, arm.n), waves)


_WAVE = re.compile(r"(?:sin|cos)\(([^()]*)\)")
_ADDEND = re.compile(r"([+-]?)(?:(\d+)\*)?q(\d+)")


def _waves_in(names: list[str], n: int) -> tuple[tuple[int, ...], ...]:
    """The wave vectors that occur in names, each once; none if all are unit vectors."""
    waves: dict[tuple[int, ...], None] = {}
    for phase in (phase for name in names for phase in _WAVE.findall(name)):
        wave = [0] * n
        for sign, size, joint in _ADDEND.findall(phase):
            if 1 <= int(joint) <= n:
                wave[int(joint) - 1] += int(size or 1) * (-1 if sign == "-" else 1)
        waves[tuple(wave)] = None
    return tuple(waves) if any(sum(map(abs, wave)) != 1 or min(wave) < 0 for wave in waves) else ()


def _parse_product(name: str, known: dict[str, int], n: int) -> list[int]:
    row: list[int] = []
    for part in re.split(r"\*(?![^(]*\))", name):
        match = re.fullmatch(r"(.+?)(?:\^(\d+))?", part)
        if match is None or match[1] not in known:
            raise ModelError(f"unknown term {name!r}: {part!r} is no function of {n} joints")
        row += [known[match[1]]] * int(match[2] or 1)
    return sorted(row)


@dataclass(frozen=True, eq=False)
class RigidBody:
    """Inertial parameters of all links (and rotors), as far as the data reveal them.

    Attributes:
        parameters: (10 n,) or, with rotor inertias, (11 n,): full parameters that have the identified base
            parameters: of links that can exist, unless the data contradict those; near the nominal ones.
        names, values: the base parameters, readable.
    """

    parameters: Array
    names: tuple[str, ...]
    values: Array
    kind: ClassVar[str] = "rigid_body"

    def torque(self, arm: Arm, motion: Motion, step: int) -> Array:
        v = motion.v if step >= 2 else np.zeros_like(motion.v)
        vdot = motion.vdot if step >= 3 else np.zeros_like(motion.vdot)
        n = arm.n
        tau = joint_torques(arm, self.parameters[: 10 * n], motion.q, v, vdot)
        return tau + self.parameters[10 * n :] * vdot if len(self.parameters) == 11 * n else tau

    def rotors(self, n: int) -> Array:
        """(n,) rotor inertias that the data tell from the links' own: what turns before the gears loads no joint."""
        known = dict(zip(self.names, self.values.tolist(), strict=True))
        return np.array([known.get(name, 0.0) for name in rotor_names(n)])

    def terms(self, arm: Arm, joint: int) -> list[Term]:
        """The base parameters that act on the joint, each times its column of the regressor.

        ``Y1[mx2]`` is the torque of joint 1 per unit of mx2; a parameter of link k acts on joints 1 … k.
        """
        found = []
        for name, value in zip(self.names, self.values, strict=True):
            if not value:
                continue
            lead = name.split(" ")[0]
            link = int(re.sub(r"\D", "", lead))
            acts = link == joint + 1 if lead.startswith("J") else link >= joint + 1
            if acts:
                found.append((3, float(value), f"Y{joint + 1}[{lead}]"))
        return found

    def legend(self) -> list[str]:
        """The base parameters in full: sums of link parameters (m, m c, inertia about the link's origin; SI)."""
        found = [
            f"{name.split(' ')[0]}: {value:.4g} = {name}"
            for name, value in zip(self.names, self.values, strict=True)
            if value
        ]
        return [_LEGEND, *found] if found else []

    def to_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "base_parameters": dict(zip(self.names, self.values.tolist(), strict=True)),
            "parameters": self.parameters.tolist(),
        }

    @staticmethod
    def from_dict(data: dict[str, Any], arm: Arm) -> RigidBody:
        base, parameters = data["base_parameters"], np.array(data["parameters"], dtype=float)
        known = set(parameter_names(arm.n, rotors=True))
        for name in base:
            if name.split(" ")[0] not in known:
                raise ModelError(
                    f"base_parameters: {name!r:.60} is no sum of parameters of an arm of {arm.n} joints"
                )
        return RigidBody(parameters, tuple(base), np.array(list(base.values()), dtype=float))


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """Kinetic and potential energy as sums of few terms; the torques follow by Euler-Lagrange.

    Attributes:
        energy: the terms (see :class:`EnergyTerms`).
        coefficients: (p,) in J per unit of each term.
    """

    energy: EnergyTerms
    coefficients: Array
    kind: ClassVar[str] = "lagrangian"

    def torque(self, arm: Arm, motion: Motion, step: int) -> Array:
        v = motion.v if step >= 2 else np.zeros_like(motion.v)
        vdot = motion.vdot if step >= 3 else np.zeros_like(motion.vdot)
        part = Motion(motion.time, motion.q, v, vdot, motion.starts)
        return self.energy.columns(part) @ self.coefficients

    def mass_matrix(self, q: Array) -> Array:
        """(N, n, n) M(q) at postures q (N, n), symmetric by construction."""
        return self.energy.mass(q) @ self.coefficients

    def terms(self, arm: Arm, joint: int) -> list[Term]:
        """The derivatives of the energies that make the joint's torque; the legend spells the energies out."""
        acts, potential, m = self.energy.acts[joint], self.energy.potential, joint + 1
        found: list[Term] = []
        if (acts & potential).any():
            found.append((1, 1.0, f"dU/dq{m}"))
        if (acts & ~potential).any():
            found.append((3, 1.0, f"(d/dt(dT/dv{m}) - dT/dq{m})"))
        return found

    def legend(self) -> list[str]:
        """The two energies, in J for rad, m and s."""
        lines = []
        for name, chosen in (("T", ~self.energy.potential), ("U", self.energy.potential)):
            pairs = zip(self.coefficients[chosen], np.array(self.energy.names)[chosen], strict=True)
            text = " ".join(f"{'-' if c < 0 else '+'} {abs(c):.4g}*{term}" for c, term in pairs if c)
            lines.append(f"{name} = {text.removeprefix('+ ') or '0'}")
        return lines

    def to_dict(self) -> dict[str, Any]:
        energy = self.energy
        columns = zip(
            energy.names,
            self.coefficients.tolist(),
            energy.degrees.tolist(),
            energy.sine.tolist(),
            (energy.speeds + 1).tolist(),
            strict=True,
        )
        keys = ("term", "coefficient", "degrees", "sine", "speeds")
        return {"kind": self.kind, "terms": [dict(zip(keys, row, strict=True)) for row in columns]}

    @staticmethod
    def from_dict(data: dict[str, Any], arm: Arm) -> Lagrangian:
        rows = data["terms"]
        degrees = np.array([row["degrees"] for row in rows], dtype=int).reshape(-1, arm.n)
        speeds = np.array([row["speeds"] for row in rows], dtype=int).reshape(-1, 2) - 1
        if ((speeds < -1) | (speeds >= arm.n) | ((speeds < 0) != (speeds[:, :1] < 0))).any():
            raise ModelError(
                f"lagrangian: speeds must be two joints from 1 to {arm.n}, or 0, 0 for a term of U"
            )
        if (degrees[:, ~arm.revolute] < 0).any():
            raise ModelError("lagrangian: a prismatic joint's degree must not be negative")
        sine = np.array([row["sine"] for row in rows], dtype=bool)
        energy = EnergyTerms(arm.revolute, degrees, sine, speeds)
        return Lagrangian(energy, np.array([float(row["coefficient"]) for row in rows]))


COMPONENTS: dict[str, type[SparseTerms] | type[RigidBody] | type[Lagrangian]] = {
    kind.kind: kind for kind in (SparseTerms, RigidBody, Lagrangian)
}
