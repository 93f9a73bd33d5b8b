"""Periodic Fourier series that start and end at rest: motions as linear functions of few coefficients.

q_i(t) = c_i + sum_h [a_ih cos(h w t) + b_ih sin(h w t)], h = 1..H, with sum_h h b_ih = 0 and sum_h h^2 a_ih = 0, so
that velocity and acceleration vanish at t = 0 and after every period (Swevers et al., "Optimal robot excitation and
identification", IEEE T-RA 13(5), 1997, with rest at the ends added). Such a motion can be repeated and averaged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import null_space

from armloop.data.motion import Motion
from armloop.experiment.excitation import FourierReference
from armloop.util.arrays import Array


@dataclass(frozen=True)
class Series:
    """The family of such motions of n joints.

    Attributes:
        joints: n.
        harmonics: H, at least 2; the two conditions of rest leave 2 H - 2 free coefficients a joint.
        period: s.
    """

    joints: int
    harmonics: int
    period: float

    def __post_init__(self) -> None:
        if self.harmonics < 2 or not self.period > 0:
            raise ValueError(f"harmonics {self.harmonics} must be at least 2, period {self.period} above 0")

    @property
    def free(self) -> int:
        """Number of coefficients of a joint: its centre and 2 H - 2 of its motion."""
        return 2 * self.harmonics - 1

    @cached_property
    def _omega(self) -> Array:
        return 2 * np.pi / self.period * np.arange(1.0, self.harmonics + 1)

    @cached_property
    def _to_waves(self) -> Array:
        """(2 H, 2 H - 2): free coefficients -> (a, b).

        The free coefficients are amplitudes of velocity, which keeps slow and fast harmonics of one size.
        """
        h, zero = np.arange(1.0, self.harmonics + 1), np.zeros(self.harmonics)
        # with a = x / (h w), b = y / (h w): sum h x = 0, sum y = 0
        rest = np.array([np.concatenate([h, zero]), np.concatenate([zero, np.ones_like(h)])])
        return np.asarray(null_space(rest) / np.tile(self._omega, 2)[:, None])

    def tables(self, t: Array) -> tuple[Array, Array, Array]:
        """Matrices (K, free) that give q, v, vdot at the times t (K,) as `table @ x.T` for coefficients x (n, free)."""
        phase = t[:, None] * self._omega
        c, s, w = np.cos(phase), np.sin(phase), self._omega
        waves = (np.hstack([c, s]), np.hstack([-w * s, w * c]), np.hstack([-(w**2) * c, -(w**2) * s]))
        q, v, vdot = (wave @ self._to_waves for wave in waves)
        one, none = np.ones((len(t), 1)), np.zeros((len(t), 1))
        return np.hstack([one, q]), np.hstack([none, v]), np.hstack([none, vdot])

    def reference(self, x: Array, periods: int = 1) -> FourierReference:
        """The motion with coefficients x (n, free): centre, then the free ones."""
        waves = x[:, 1:] @ self._to_waves.T
        h = self.harmonics
        omega = np.tile(self._omega, (self.joints, 1))
        return FourierReference(x[:, 0].copy(), waves[:, :h], waves[:, h:], omega, periods * self.period)


def sampled(reference: FourierReference, step: float) -> Motion:
    """A reference at times 0, step, ... before its end."""
    t = np.arange(0.0, reference.duration - 1e-9, step)
    return Motion(t, *reference.evaluate(t))
