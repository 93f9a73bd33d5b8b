"""Motions as Drake sources: tables, sampled once, held over each period as a controller of that period reads them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import BasicVector, Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Demultiplexer

from armloop.excitation import Reference

Array = NDArray[np.float64]


class TableSource(LeafSystem):
    """Hold a table, one row per period.

    Output port `row`: (width,), row k around k periods; the last row afterwards.
    """

    def __init__(self, width: int, period: float) -> None:
        """width : of the rows, all zero until `set_rows`; period : s."""
        super().__init__()
        self._rows = np.zeros((1, width))
        self._period = period
        self.DeclareVectorOutputPort("row", width, self._calc_row)

    def set_rows(self, rows: Array) -> None:
        """Replace the table; `rows` is (K, width). Reset the context's time afterwards."""
        self._rows = rows

    def _calc_row(self, context: Context, output: BasicVector) -> None:
        row = min(int(context.get_time() / self._period + 0.5), len(self._rows) - 1)
        output.SetFromVector(self._rows[row])


class ReferenceSource(Diagram):
    """Give q_ref(t), v_ref(t), vdot_ref(t) of a reference, held over each period.

    Output ports: `q_ref`, `v_ref`, `vdot_ref`, (n,) each, in rad, rad/s, rad/s^2 (m, ..). After the
    reference's duration the last values are held. The reference is evaluated once, on construction.
    """

    def __init__(self, reference: Reference, period: float) -> None:
        """reference : what to follow; period : s."""
        super().__init__()
        self.tables = reference.evaluate(period * np.arange(round(reference.duration / period) + 1))
        n = self.tables[0].shape[1]
        builder = DiagramBuilder()
        source = builder.AddNamedSystem("table", TableSource(3 * n, period))
        source.set_rows(np.hstack(self.tables))
        split = builder.AddNamedSystem("split", Demultiplexer([n, n, n]))
        builder.Connect(source.get_output_port(), split.get_input_port())
        for index, name in enumerate(("q_ref", "v_ref", "vdot_ref")):
            builder.ExportOutput(split.get_output_port(index), name)
        builder.BuildInto(self)
