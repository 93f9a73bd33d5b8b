"""Any other table, CSV (any separator) or Parquet: its columns' names suggest a map, and a map makes it certain."""

from __future__ import annotations

from pathlib import Path

from armloop.convert.clocks import stamps_of
from armloop.convert.headers import suggest
from armloop.convert.mapping import Mapping, QuantityMap, TimeMap
from armloop.convert.recording import Array, Recording
from armloop.convert.text import TextTable, read_text
from armloop.data.header import JOINT_COLUMN
from armloop.data.tables import PARQUET, kind_of
from armloop.data.torque_unit import told_unit
from armloop.util.errors import LogError


def read_table(path: Path) -> Recording:
    """Read one table; raises ``LogError`` where it cannot be read."""
    table = _parquet(path) if kind_of(path) == PARQUET else read_text(path)
    columns, units, said = table.columns, table.units, [*table.notes, *table.left_out()]
    for stamp, (whole, rest, seconds) in stamps_of(columns).items():
        if stamp not in columns:
            del columns[whole], columns[rest]
            columns[stamp], units[stamp] = seconds, "s"
            said.append(f"{stamp}: {whole} and {rest}, counted in s from the first row")
    kind, mapping, unsure = "motion log", _own(columns, told_unit(path) or "N*m"), {}
    if mapping is None or mapping.used() & units.keys():
        found = suggest(list(columns), units=units)
        kind, mapping, unsure = "table", found.mapping, found.unsure
    for name in table.twice:  # without a map it is not known yet what is needed
        if mapping is not None and name in mapping.used():
            raise LogError(
                f"{path}: column {name} stands twice, with other numbers; give each a name of its own"
            )
    return Recording(
        path,
        kind,
        columns,
        mapping,
        starts=table.starts,
        notes=said,
        unsure=unsure,
        units=units,
        lines=table.lines,
    )


def _own(columns: dict[str, Array], tau_unit: str) -> Mapping | None:
    """The map of a table that is a motion log already: its units are SI by definition, except of tau (A or N·m)."""
    joints = {name for name in columns if JOINT_COLUMN.fullmatch(name)}
    n = sum(name.startswith("q") for name in joints)
    names = {kind: [f"{kind}{j}" for j in range(1, n + 1)] for kind in ("q", "v", "tau", "vdot")}
    needed = {"time", *names["q"], *names["v"], *names["tau"]}
    # a number beyond 1..n, zero too, is of a table that counts otherwise: none of its joints may get lost
    if n == 0 or not needed <= columns.keys() or not joints <= needed.union(names["vdot"]):
        return None
    vdot = QuantityMap(names["vdot"], "rad/s^2") if all(c in columns for c in names["vdot"]) else None
    return Mapping(
        TimeMap("time", "s"),
        QuantityMap(names["q"], "rad"),
        QuantityMap(names["tau"], tau_unit),
        QuantityMap(names["v"], "rad/s"),
        vdot,
    )


def _parquet(path: Path) -> TextTable:
    import pyarrow
    import pyarrow.parquet

    try:
        table = pyarrow.parquet.read_table(path)
    except (pyarrow.ArrowException, OSError) as error:
        raise LogError(f"{path}: not a Parquet file; write it anew, or name it .csv if it is text") from error
    made = TextTable({}, [0], [])
    for name in table.column_names:
        if not made.take(name, table.column(name)):
            made.dropped.append(f"{name} ({table.schema.field(name).type})")
    return made
