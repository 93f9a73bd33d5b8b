"""YAML files read into the descriptions of `armloop.schemas.scenarios`: what is wrong is a line with file and field."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from armloop.schemas.checking import Misfit, checked
from armloop.util.errors import ScenarioError
from armloop.util.reading import read_yaml
from armloop.util.resources import find_scenario

T = TypeVar("T")


def per_joint(values: list[float], n: int, where: str, *, spread: bool = True) -> Any:
    """Return (n,) numbers of a list of n, or, with `spread`, of one."""
    array = np.array(values, dtype=float)
    if spread and len(array) == 1:
        return np.full(n, array[0])
    if len(array) != n:
        one = "one number or " if spread else ""
        raise ScenarioError(f"{where} has {len(array)} numbers; it must have {one}one per joint, {n}")
    return array


def beside(path: Path, name: str, where: str) -> Path:
    """Return the file that a scenario names, which must lie in the scenario's folder or below it, links followed."""
    folder = path.resolve().parent
    try:
        found = (folder / name).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise ScenarioError(f"{where}: {name[:60]!r} is the path of no file") from error
    if not found.is_relative_to(folder):
        raise ScenarioError(f"{where}: {name[:60]!r} lies outside the scenario's folder; put the file there")
    return found


def read(path: Path) -> Mapping[str, Any]:
    """Return the file as a mapping."""
    raw = read_yaml(path, ScenarioError, "a scenario's YAML file")
    if not isinstance(raw, Mapping):
        raise ScenarioError(f"{path}: a scenario must be a mapping of fields")
    return raw


def entry(path: Path, name: str, schema: type[T]) -> T:
    """Return one named entry of a file."""
    raw = read(path)
    if name not in raw:
        raise ScenarioError(f"{path}: there is no {name!r}; there are: {', '.join(sorted(raw))}")
    return typed(path, raw[name], schema, name)


def scenario_entry(spec: str | Path, schema: type[T]) -> tuple[Path, str, str, T]:
    """Return a scenario's file, its name, the words that place a fault in the file, and its fields.

    spec : a built-in name or the path of a file; a file may hold several scenarios, a mapping by name:
        then FILE:NAME, or FILE alone for the one that is named as the file, else the first
    """
    path, wanted = find_scenario(spec)
    raw = read(path)
    fields = {field.name for field in msgspec.structs.fields(schema)}  # type: ignore[arg-type]
    # a name may have nothing below it yet, which is then said of it
    several = fields.isdisjoint(raw) and any(isinstance(value, Mapping) for value in raw.values())
    if not several:
        if wanted is not None:
            raise ScenarioError(f"{path}: holds one scenario without a name; leave out :{wanted}")
        return path, path.stem, str(path), typed(path, raw, schema, None)
    chosen = wanted or (path.stem if path.stem in raw else next(iter(raw)))
    if chosen not in raw:
        raise ScenarioError(f"{path}: there is no scenario {chosen!r}; there are: {', '.join(raw)}")
    name = path.stem if chosen == path.stem else f"{path.stem}:{chosen}"
    return path, name, f"{path}: {chosen}", typed(path, raw[chosen], schema, chosen)


def typed(path: Path, raw: Any, schema: type[T], name: str | None) -> T:
    """Return an entry as an object of its description; whatever is wrong is one line with file and field."""
    where = f"{path}: {name}" if name else str(path)
    if not isinstance(raw, Mapping):
        raise ScenarioError(f"{where} is {raw!r:.60}; it must be a mapping of fields")
    try:
        return checked(raw, schema)
    except Misfit as misfit:
        raise ScenarioError(f"{where}: {misfit}") from None
