"""Least squares on all of a library at the accuracy of an orthogonal factorisation, without ever filling it."""

from __future__ import annotations

from armloop.data.motion import Motion
from armloop.features.angle_sums import AngleSums
from armloop.features.wave_moments import WaveProducts
from armloop.util.arrays import Array
from armloop_paper.refined import refined


def least_squares(library: AngleSums, motion: Motion, tau: Array) -> tuple[WaveProducts, Array]:
    """The candidates and their (T, n) coefficients for torques (N, n)."""
    waves = WaveProducts(library.factors, library.index)
    sums = waves.sums(motion, tau)
    return waves, refined(
        waves.gram(sums), sums.cross, lambda beta: waves.adjoint(motion, tau - waves.apply(motion, beta))
    )
