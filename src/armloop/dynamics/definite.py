"""Branch-and-bound proof that a mass matrix of energy terms is positive definite at every posture within limits.

Around the centre c of a box of postures, c + d with |d_m| <= h_m,

    M(c + d) = M(c) + Σ_m d_m ∂M/∂q_m(c) + R,    |R_ij| <= r_ij,

where r follows term by term: a wave f of the phase φ = k·q changes by |δ| <= w = Σ|k_m| h_m, so that what its tangent
leaves is at most |f| (1 - cos w) + |f'| (w - sin w). With M(c) = L Lᵀ, which takes the arm's large and small inertias
to one scale, M is positive definite on the whole box if

    max over the box's corners of ‖L⁻¹ Σ_m d_m ∂M/∂q_m L⁻ᵀ‖₂ + ‖|L⁻¹| r |L⁻ᵀ|‖ < 1,

for the first is convex in d. Boxes that do not show it are halved along the joint that counts most, until all do, M(c)
is not positive definite itself, or the work is too much. Only joints that M depends on are cut.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armloop.features.lagrangian import EnergyTerms
from armloop.util.arrays import Array, Index, Mask

#: Boxes looked at, at most; and products in them, which take a second or two.
_BOXES, _WORK = 20_000, 2e9
#: Boxes at a time.
_TOGETHER = 512
#: Relative error of a term: rounding of its phase, of its sine, and of the sums.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class Proof:
    """How much of a box of postures has a positive definite M(q).

    Attributes:
        share: part of its volume on which that is proven; 1 is all.
        least: the smallest eigenvalue that M(q) can have there, as far as is proven; inf where nothing is.
        indefinite: (n,) a posture at which M(q) is not positive definite, if one was met.
        boxes: how many were looked at.
    """

    share: float
    least: float
    indefinite: Array | None
    boxes: int

    @property
    def complete(self) -> bool:
        """Whether M(q) is positive definite at every posture."""
        return self.share == 1


@dataclass(frozen=True, eq=False)
class MassTerms:
    """M(q) as a sum of functions of the posture.

    Attributes:
        waves: (T, n) multiples of q in each function's phase.
        powers: (T, n) powers of prismatic coordinates that are factors of it.
        sine: (T,) whether it is the sine of the phase, not the cosine.
        matrices: (T, n, n) what it is multiplied by.
        constant: (n, n) symmetric, what is the same at all postures.
    """

    waves: Array
    powers: NDArray[np.int_]
    sine: Mask
    matrices: Array
    constant: Array

    @staticmethod
    def of(energy: EnergyTerms, coefficients: Array, constant: Array) -> MassTerms:
        """The terms of a kinetic energy with their coefficients (p,), beside a constant inertia (n, n)."""
        kept = np.flatnonzero(~energy.potential & (coefficients != 0))
        degrees, (first, second) = energy.degrees[kept], energy.speeds[kept].T
        matrices, each = np.zeros((len(kept), *constant.shape)), np.arange(len(kept))
        matrices[each, first, second] += coefficients[kept]
        matrices[each, second, first] += coefficients[kept]
        return MassTerms(
            np.where(energy.revolute, degrees, 0).astype(float),
            np.where(energy.revolute, 0, degrees),
            energy.sine[kept],
            matrices,
            0.5 * (constant + constant.T),
        )

    @cached_property
    def joints(self) -> Index:
        """(k,) joints that M depends on."""
        return np.flatnonzero((self.waves != 0).any(axis=0) | (self.powers != 0).any(axis=0))

    @cached_property
    def _corners(self) -> Array:
        """(C, k) signs of a box's corners; of two that are opposite, one."""
        k = len(self.joints)
        return np.array(list(product((1.0, -1.0), repeat=k)))[: max(1, 2 ** (k - 1))]

    @property
    def work(self) -> float:
        """Products that a box takes, about."""
        terms, n, k = len(self.sine), len(self.constant), len(self.joints)
        return terms * n**2 * (2 * k + 4) + 30 * len(self._corners) * n**3

    def at(self, q: Array) -> Array:
        """(B, n, n) M at postures q (B, n)."""
        phase = q @ self.waves.T
        f = np.where(self.sine, np.sin(phase), np.cos(phase)) * self._factor(q)
        return np.asarray(self.constant + np.tensordot(f, self.matrices, 1))

    def margins(self, centre: Array, half: Array, M: Array) -> tuple[Array, Array]:
        """How far M stays from indefinite on boxes, relative to M at their centres, and which joint to cut.

        Args:
            centre, half: (B, n) centres and half widths.
            M: (B, n, n) positive definite, at the centres.

        Returns:
            (B,) numbers μ with M(q) >= μ M(centre) at every q of the box, and (B, k) weights of the joints.
        """
        tangents, rest, shares = self._changes(centre, half)
        inverse = np.linalg.inv(np.linalg.cholesky(M))
        turned = inverse.swapaxes(1, 2)
        A = inverse[:, None] @ tangents @ turned[:, None]
        ends = np.einsum("cm,bmij->bcij", self._corners, A)
        first = np.abs(np.linalg.eigvalsh(ends)).max(axis=(1, 2))
        far, near = np.abs(inverse), np.abs(turned)
        W = far @ rest @ near
        second = np.minimum(np.linalg.norm(W, axis=(1, 2)), W.sum(axis=2).max(axis=1))
        weights = np.linalg.norm(A, axis=(2, 3)) + np.linalg.norm(
            far[:, None] @ shares @ near[:, None], axis=(2, 3)
        )
        return 1 - first - second, weights

    def _changes(self, centre: Array, half: Array) -> tuple[Array, Array, Array]:
        """h_m ∂M/∂q_m (B, k, n, n), the bound r (B, n, n), and what each joint has in it, about (B, k, n, n)."""
        n, k = len(self.constant), len(self.joints)
        phase, w = centre @ self.waves.T, half @ np.abs(self.waves).T
        sine, cosine = np.sin(phase), np.cos(phase)
        f, slope = np.where(self.sine, sine, cosine), np.where(self.sine, cosine, -sine)
        size, most = (self._factor(x) for x in (np.abs(centre), np.abs(centre) + half))
        factor, steps, shares, rising = self._factor(centre), [], [], np.zeros_like(f)
        for m in self.joints:
            h, turning = half[:, [m]], half[:, [m]] * self.waves[:, m]
            # |q|^a bounds q^a and its slope: what is beyond a tangent of q^a is at most what is beyond one of |q|^a.
            rise = h * self._slope(np.abs(centre), m)
            rising += rise
            steps.append(slope * turning * factor + f * h * self._slope(centre, m))
            shares.append(0.5 * w * np.abs(turning) * most + rise)
        curved = np.abs(f) * (1 - np.cos(np.minimum(w, np.pi))) + np.abs(slope) * (w - np.sin(w))
        rest = (curved + _ROUNDING) * most
        rest += np.abs(f) * (most - size - rising) + np.abs(slope) * w * (most - size)
        raw, cells = self.matrices.reshape(-1, n * n), (len(f), k, n, n)
        tangents, mine = (np.reshape(x, (k, *f.shape)).swapaxes(0, 1) for x in (steps, shares))
        return (
            (tangents @ raw).reshape(cells),
            (rest @ np.abs(raw)).reshape(-1, n, n),
            (mine @ np.abs(raw)).reshape(cells),
        )

    def _factor(self, q: Array) -> Array:
        """(B, T) products of powers of q."""
        if not self.powers.any():
            return np.ones((len(q), len(self.sine)))
        return np.asarray(np.prod(q[:, None] ** self.powers, axis=2))

    def _slope(self, q: Array, joint: int) -> Array:
        """(B, T) their derivatives by one coordinate."""
        if not self.powers[:, joint].any():
            return np.zeros((len(q), len(self.sine)))
        lower = self.powers.copy()
        lower[:, joint] = np.maximum(lower[:, joint] - 1, 0)
        return np.asarray(self.powers[:, joint] * np.prod(q[:, None] ** lower, axis=2))


def prove_definite(terms: MassTerms, low: Array, high: Array) -> Proof:
    """Prove that M(q) is positive definite at every posture from ``low`` to ``high``, (n,) each, as far as it can be.

    The widest boxes come first.
    """
    joints = terms.joints
    centre, half = 0.5 * (low + high)[None], np.zeros((1, len(low)))
    half[:, joints] = 0.5 * (high - low)[joints]
    volume, share, least, boxes = np.ones(1), 0.0, np.inf, 0
    most = min(_BOXES, max(1, int(_WORK / terms.work)))
    while len(centre) and boxes < most:
        c, h, size = centre[:_TOGETHER], half[:_TOGETHER], volume[:_TOGETHER]
        boxes += len(c)
        M = terms.at(c)
        values = np.linalg.eigvalsh(M)[:, 0]
        worst = int(values.argmin())
        if values[worst] <= 0:
            return Proof(share, least, c[worst], boxes)
        margin, weights = terms.margins(c, h, M)
        proven = margin > 0
        share += float(size[proven].sum())
        least = min([least, *(margin * values)[proven]])
        c, h, size, cut = c[~proven], h[~proven], 0.5 * size[~proven], weights[~proven]
        step, each = np.zeros_like(c), np.arange(len(c))
        if len(c):
            along = joints[cut.argmax(axis=1)]
            step[each, along] = 0.5 * h[each, along]
        centre, half, volume = (
            np.concatenate([old[_TOGETHER:], *new])
            for old, new in (
                (centre, (c - step, c + step)),
                (half, (h - step, h - step)),
                (volume, (size, size)),
            )
        )
    return Proof(1.0 if not len(centre) else min(share, np.nextafter(1, 0)), least, None, boxes)
