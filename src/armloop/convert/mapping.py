"""A map from a table's columns to a motion log: which column holds what, in which unit, sign and joint order.

The file is YAML, one field per quantity; what it leaves out is not in the source::

    schema: armloop/map/1
    time: {column: timestamp, unit: ms}      # or {rate: 500} for samples at so many Hz
    joints: [shoulder, elbow]                # names, in the order of the columns; matched with the arm's
    q: {columns: [pos_a, pos_b], unit: deg, sign: [1, -1], offset: [0, 90]}
    v: {columns: [vel_a, vel_b], unit: deg/s, sign: [1, -1]}
    tau: {columns: "i_{1..2}", unit: A, gains: [8.1, 7.9]}   # N·m per A (of mA, too) or per %
    keep: all                                # or the names of further columns to keep, or []

A number, unit or sign stands for all joints, a list gives one per joint. An ``offset`` is in the column's unit
and added before the sign. A column that counts has a ``scale``, what one count is in the unit: of a servo with 4096
counts per turn whose zero is at 2048, ``{unit: rev, scale: 0.000244140625, offset: -2048}``. ``"i_{1..2}"`` stands
for ``[i_1, i_2]``. A ``?`` is a question still to be answered.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, TypeVar

import msgspec

from armloop.convert.units import FACTORS, canonical
from armloop.schemas.checking import Misfit, checked
from armloop.schemas.types import MOST_JOINTS, Finite
from armloop.util.errors import InputError
from armloop.util.reading import read_yaml

SCHEMA = "armloop/map/1"
UNSAID = "?"
_RANGE = re.compile(r"\{(\d+)\.\.(\d+)\}")

T = TypeVar("T")


class TimeMap(msgspec.Struct, forbid_unknown_fields=True):
    """Where the time comes from: a column and its unit, or an even rate in Hz."""

    column: str | None = None
    unit: str | None = None
    rate: Annotated[float, msgspec.Meta(gt=0, lt=1e6, description="Hz")] | None = None


class QuantityMap(msgspec.Struct, forbid_unknown_fields=True):
    """The columns of one quantity, base to tip or in the order of ``joints``."""

    columns: list[str] | str
    unit: str | list[str] | None = None
    sign: Finite | list[Finite] = 1.0
    offset: Finite | list[Finite] = 0.0
    scale: Finite | list[Finite] = 1.0
    gains: Finite | list[Finite] | None = None

    def names(self) -> list[str]:
        """The columns' names, with a range written out, to one more than any arm has."""
        if not isinstance(self.columns, str):
            return self.columns
        found = _RANGE.search(self.columns)
        if found is None:
            return [self.columns]
        first = int(found[1])
        last = min(int(found[2]), first + MOST_JOINTS)
        before, after = self.columns[: found.start()], self.columns[found.end() :]
        return [f"{before}{k}{after}" for k in range(first, last + 1)]

    def units(self) -> list[str | None]:
        """The columns' units; None where one is not said."""
        units = self.unit if isinstance(self.unit, list) else [self.unit] * len(self.names())
        return [None if unit == UNSAID else unit for unit in units]


class Mapping(msgspec.Struct, forbid_unknown_fields=True):
    """What each column of a source is; see the module."""

    time: TimeMap
    q: QuantityMap
    tau: QuantityMap
    v: QuantityMap | None = None
    vdot: QuantityMap | None = None
    joints: list[str] | None = None
    keep: str | list[str] = "all"
    schema: str = SCHEMA

    def quantities(self) -> dict[str, QuantityMap]:
        """The quantities that the source has, by name."""
        found = {"q": self.q, "v": self.v, "tau": self.tau, "vdot": self.vdot}
        return {name: quantity for name, quantity in found.items() if quantity is not None}

    def used(self) -> set[str]:
        """The names of all columns that a quantity or the time is made of."""
        return {
            self.time.column or "",
            *(name for each in self.quantities().values() for name in each.names()),
        }

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.q.names())


def read_map(path: str | Path) -> Mapping:
    """Read and check a map; raises ``InputError``, which names the field, where it is none."""
    try:
        mapping = checked(read_yaml(path, InputError, "a map, a YAML file"), Mapping)
    except Misfit as misfit:
        raise InputError(
            f"{path}: no map: {misfit}; `armloop convert SOURCE --suggest` writes one to start from"
        ) from None
    check_map(mapping, str(path))
    return mapping


def check_map(mapping: Mapping, where: str) -> None:
    """Raise ``InputError`` unless units are known, lists have one entry per joint, and nothing is asked twice."""
    if mapping.schema != SCHEMA:
        raise InputError(f"{where}: schema is {mapping.schema!r}; it must be {SCHEMA}")
    if (mapping.time.column is None) == (mapping.time.rate is None):
        raise InputError(f"{where}: time: give either column (with its unit) or rate in Hz")
    open_fields = [name for name, quantity in mapping.quantities().items() if UNSAID in quantity.names()]
    if mapping.time.column == UNSAID:
        open_fields.insert(0, "time")
    if open_fields:
        raise InputError(
            f"{where}: {' and '.join(open_fields)}: the columns are still {UNSAID!r}; name them, one per joint, base to tip"
        )
    _check_unit(mapping.time.unit, "time", where)
    n = mapping.n
    if not 1 <= n <= MOST_JOINTS:
        raise InputError(f"{where}: q: give the columns of 1 to {MOST_JOINTS} joints")
    if mapping.joints is not None and len(mapping.joints) != n:
        raise InputError(
            f"{where}: joints: {len(mapping.joints)} names for {n} columns of q; give one per column"
        )
    joints = mapping.joints or []
    for name in joints:
        if joints.count(name) > 1:
            raise InputError(
                f"{where}: joints: {name} stands twice; give each joint of the arm once, base to tip"
            )
    for name, quantity in mapping.quantities().items():
        if len(quantity.names()) != n:
            raise InputError(
                f"{where}: {name}: {len(quantity.names())} columns, but q has {n}; give one per joint"
            )
        for field in ("unit", "sign", "offset", "scale", "gains"):
            value = getattr(quantity, field)
            if isinstance(value, list) and len(value) != n:
                raise InputError(f"{where}: {name}: {field} has {len(value)} entries; give one, or {n}")
        for unit in quantity.units():
            _check_unit(unit, name, where)
        if any(abs(sign) != 1 for sign in per_joint(quantity.sign, n)):
            raise InputError(f"{where}: {name}: sign must be 1 or -1; what a column counts in is its scale")
        if not all(scale > 0 for scale in per_joint(quantity.scale, n)):
            raise InputError(f"{where}: {name}: every scale must be positive; say a direction with sign")
        if quantity.gains is not None and name != "tau":
            raise InputError(f"{where}: {name}: gains belong to tau alone (N·m per A, or per % of a rating)")
        if quantity.gains is not None and not all(gain > 0 for gain in per_joint(quantity.gains, n)):
            raise InputError(f"{where}: tau: every gain must be positive; say a direction with sign")
    taken = {mapping.time.column or "": "time"}
    for kind, quantity in mapping.quantities().items():
        for j, name in enumerate(quantity.names(), start=1):
            if name in taken:
                raise InputError(
                    f"{where}: {kind}: column {name} is {taken[name]} already; each column is one quantity of one joint"
                )
            taken[name] = f"{kind} of joint {j}"
    if isinstance(mapping.keep, str) and mapping.keep != "all":
        raise InputError(f"{where}: keep is {mapping.keep!r}; it must be all or a list of columns")


def per_joint(value: T | list[T], n: int) -> list[T]:
    """One value for each of n joints."""
    return value if isinstance(value, list) else [value] * n


def _check_unit(unit: str | None, quantity: str, where: str) -> None:
    if unit not in (None, UNSAID) and canonical(unit or "", quantity) is None:
        raise InputError(
            f"{where}: {quantity}: unit {unit!r} is unknown; it must be one of {', '.join(FACTORS[quantity])}"
        )
