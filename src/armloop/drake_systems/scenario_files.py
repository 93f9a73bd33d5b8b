"""YAML files read into the dataclasses of `scenario_data`: whatever is wrong is one line with file and field."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydrake.common.yaml import yaml_load_file, yaml_load_typed

from armloop.errors import ScenarioError
from armloop.resources import find_scenario

T = TypeVar("T")


def per_joint(values: list[float], n: int, where: str, *, spread: bool = True) -> Any:
    """Return (n,) finite numbers of a list of n, or, with `spread`, of one."""
    array = np.array(values, dtype=float)
    if not np.isfinite(array).all():
        raise ScenarioError(f"{where} is {values}; it must hold finite numbers")
    if spread and len(array) == 1:
        return np.full(n, array[0])
    if len(array) != n:
        one = "one number or " if spread else ""
        raise ScenarioError(f"{where} has {len(array)} numbers; it must have {one}one per joint, {n}")
    return array


def read(path: Path) -> Mapping[str, Any]:
    """Return the file as a mapping."""
    try:
        raw = yaml_load_file(str(path))
    except Exception as error:  # the reader passes the YAML parser's own errors through
        raise ScenarioError(f"{path}: unreadable YAML: {error}") from error
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
    fields = get_type_hints(schema)
    several = raw and all(key not in fields and isinstance(value, Mapping) for key, value in raw.items())
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
    """Check fields and types, with messages a person understands; then let Drake's reader do its part."""
    _check(raw, schema, f"{path}: {name}" if name else str(path))
    try:
        return yaml_load_typed(schema=schema, filename=str(path), child_name=name, defaults=schema())
    except Exception as error:
        raise ScenarioError(f"{path}: {name or 'scenario'}: {error}") from error


def _check(raw: Any, schema: Any, where: str) -> None:
    """Raise `ScenarioError` unless `raw` has the fields and types of `schema`."""
    if get_origin(schema) is Union:
        if raw is not None:
            _check(raw, get_args(schema)[0], where)
    elif get_origin(schema) is list:
        if not isinstance(raw, list):
            raise ScenarioError(f"{where} is {raw!r}; it must be a list")
        for index, item in enumerate(raw):
            _check(item, get_args(schema)[0], f"{where}[{index + 1}]")
    elif dataclasses.is_dataclass(schema):
        if not isinstance(raw, Mapping):
            raise ScenarioError(f"{where} is {raw!r}; it must be a mapping of fields")
        hints = get_type_hints(schema)
        for key, value in raw.items():
            if key not in hints:
                raise ScenarioError(f"{where}: field {key!r} is unknown; there are: {', '.join(hints)}")
            _check(value, hints[key], f"{where}: {key}")
    elif schema is float:
        if isinstance(raw, bool) or not isinstance(raw, int | float) or not np.isfinite(raw):
            raise ScenarioError(f"{where} is {raw!r}; it must be a finite number")
    elif schema is int:
        if isinstance(raw, bool) or not isinstance(raw, int):
            raise ScenarioError(f"{where} is {raw!r}; it must be a whole number")
    elif not isinstance(raw, schema):
        raise ScenarioError(f"{where} is {raw!r}; it must be a {schema.__name__}")
