"""MATLAB files up to version 7 (``save -v7``): matrices (N, n) or (n, N), plain or inside a struct."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from armloop.convert.headers import suggest
from armloop.convert.recording import Recording, flatten
from armloop.util.errors import LogError


def read_matlab(path: Path) -> Recording:
    """Read all numeric variables, which their names explain; raises ``LogError`` for what is no file of logs."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path, squeeze_me=False, struct_as_record=True)
    except NotImplementedError as error:
        raise LogError(
            f"{path}: MATLAB 7.3 (HDF5) is not read; in MATLAB, save it with save(…, '-v7')"
        ) from error
    except (MatReadError, ValueError, TypeError, OSError, EOFError, IndexError, MemoryError) as error:
        raise LogError(f"{path}: no MATLAB file ({error}); save it with save(…, '-v7')") from error
    arrays: dict[str, Any] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, arrays)
    return from_arrays(path, "MATLAB file", arrays)


def from_arrays(path: Path, kind: str, arrays: dict[str, Any]) -> Recording:
    """A recording of named arrays, with what their names suggest."""
    columns = flatten(arrays)
    if not columns:
        raise LogError(f"{path}: holds no numeric arrays with one row per sample")
    found = suggest(list(columns))
    if found.mapping is not None and found.mapping.time.column is None:
        found.unsure.setdefault("time", "no time was recognised")
    left = sorted(set(arrays) - {name.partition("[")[0] for name in columns})
    notes = [f"arrays without one row per sample, left out: {', '.join(left)}"] if left else []
    return Recording(path, kind, columns, found.mapping, notes=notes, unsure=found.unsure)


def _collect(name: str, value: Any, arrays: dict[str, Any]) -> None:
    if isinstance(value, np.ndarray) and value.dtype.names:
        if value.size == 1:
            for field in value.dtype.names:
                _collect(f"{name}.{field}", value.reshape(-1)[0][field], arrays)
    elif isinstance(value, np.ndarray) and value.dtype == object and value.size == 1:
        _collect(name, value.reshape(-1)[0], arrays)
    elif isinstance(value, np.ndarray):
        arrays[name] = value
