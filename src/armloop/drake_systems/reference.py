"""A reference motion as a Drake source."""

from __future__ import annotations

from functools import partial

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from armloop.excitation import Reference


class ReferenceSource(LeafSystem):
    """Give q_ref(t), v_ref(t), vdot_ref(t), held over each period as a controller of that period reads it.

    Output ports: `q_ref`, `v_ref`, `vdot_ref`, (n,) each, in rad, rad/s, rad/s^2 (m, ..). After the
    reference's duration the last values are held. The reference is evaluated once, on construction.
    """

    def __init__(self, reference: Reference, period: float) -> None:
        """reference : what to follow; period : s."""
        super().__init__()
        self._period = period
        t = period * np.arange(round(reference.duration / period) + 1)
        self.tables = reference.evaluate(t)
        for name, table in zip(("q_ref", "v_ref", "vdot_ref"), self.tables, strict=True):
            self.DeclareVectorOutputPort(name, table.shape[1], partial(self._calc_row, table))

    def _calc_row(self, table: np.ndarray, context: Context, output: BasicVector) -> None:
        row = min(int(context.get_time() / self._period + 0.5), len(table) - 1)
        output.SetFromVector(table[row])
