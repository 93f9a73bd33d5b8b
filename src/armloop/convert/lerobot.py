"""LeRobot data sets: a folder with ``meta/info.json`` and ``data/**/*.parquet``, or one of its Parquet files.

``observation.state`` is a list per row; ``info.json`` names its entries. Positions may be in degrees, rad or
normalised, and torques are there only where a robot's driver records them (``observation.effort`` and the like):
the data set says neither, so both are asked for.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from armloop.convert.headers import suggest
from armloop.convert.mapping import Mapping, QuantityMap, TimeMap
from armloop.convert.recording import Array, Recording, flatten
from armloop.data.tables import is_number
from armloop.util.errors import LogError
from armloop.util.reading import read_json

_TORQUES = (
    "observation.effort",
    "observation.torque",
    "observation.current",
    "effort",
    "torque",
    "observation.state.effort",
)
_VELOCITIES = ("observation.velocity", "observation.state.velocity", "velocity")
_ENDINGS = {
    "q": ("pos", "position", "q"),
    "v": ("vel", "velocity"),
    "tau": ("effort", "torque", "tau", "current", "trq"),
}


def is_lerobot(path: Path) -> bool:
    """Whether a folder or a Parquet file is a LeRobot data set."""
    if path.is_dir():
        return (path / "meta" / "info.json").is_file()
    import pyarrow
    import pyarrow.parquet

    try:
        names = pyarrow.parquet.read_schema(path).names
    except (pyarrow.ArrowInvalid, OSError) as error:
        raise LogError(f"{path}: not a Parquet file; write it anew, or name it .csv if it is text") from error
    return "observation.state" in names


def read_lerobot(path: Path) -> Recording:
    """Read all episodes, each a run of its own; a map has to say where the torques are if no name does."""
    import pyarrow.parquet

    files = sorted((path / "data").rglob("*.parquet")) if path.is_dir() else [path]
    if not files:
        raise LogError(f"{path}: the data set holds no data/**/*.parquet")
    info = _info(path)
    tables = [pyarrow.parquet.read_table(file) for file in files]
    arrays: dict[str, Any] = {}
    for name in tables[0].column_names:
        parts = [_array(table.column(name)) for table in tables if name in table.column_names]
        if len(parts) == len(tables) and all(part is not None for part in parts):
            arrays[name] = np.concatenate([part for part in parts if part is not None])
    features = info.get("features")
    columns: dict[str, Array] = {}
    for name, values in arrays.items():
        feature = features.get(name) if isinstance(features, dict) else None
        entries = _names(feature.get("names")) if isinstance(feature, dict) else []
        if values.ndim == 2 and len(entries) == values.shape[1]:
            columns |= {f"{name}/{entry}": values[:, k] for k, entry in enumerate(entries)}
        else:
            columns |= flatten({name: values})
    found = _mapping(columns, _rate(info, path))
    mapping, unsure = (None, {"columns": found}) if isinstance(found, str) else (found, {})
    episode = arrays.get("episode_index")
    starts = [0] if episode is None else [0, *(int(k) + 1 for k in np.flatnonzero(np.diff(episode)))]
    notes = [f"{len(starts)} episode{'s' * (len(starts) != 1)}"]
    named = mapping is not None and mapping.joints is not None
    return Recording(
        path,
        "LeRobot data set",
        columns,
        mapping,
        named=named,
        starts=starts,
        notes=notes,
        unsure=unsure,
    )


def _rate(info: dict[str, Any], path: Path) -> float | None:
    """Frames per second; None where the data set does not say."""
    fps = info.get("fps")
    if fps is None:
        return None
    if isinstance(fps, bool) or not isinstance(fps, int | float) or not 0 < fps < 1e6:
        raise LogError(f"{path}: meta/info.json: fps is {fps!r:.60}; it must be a positive number of Hz")
    return float(fps)


def _mapping(columns: dict[str, Array], fps: float | None) -> Mapping | str:
    """The map that names give, or why they give none."""
    time = TimeMap("timestamp", "s") if "timestamp" in columns else TimeMap(rate=fps)
    states = [name for name in columns if name.startswith("observation.state")]
    by_ending = {kind: [n for n in states if _ending(n) in endings] for kind, endings in _ENDINGS.items()}
    torques = next((found for stem in _TORQUES if (found := _of(columns, stem))), by_ending["tau"])
    velocities = next((found for stem in _VELOCITIES if (found := _of(columns, stem))), by_ending["v"])
    positions = by_ending["q"] or [name for name in states if name not in (*torques, *velocities)]
    held = {_stem(name) for name in positions}
    # what has no name is taken in its order; a name that is no position's may be any joint's
    called = [name for name in torques if "/" in name] if any("/" in name for name in positions) else []
    if strange := [name for name in called if _stem(name) not in held]:
        return f"{', '.join(strange)} belong to no position by name, of {', '.join(positions)}"
    positions, torques, velocities = _paired(positions, torques, velocities)
    if not positions or len(torques) != len(positions):
        guess = suggest(list(columns)).mapping
        if guess is not None and guess.time.column is not None:
            return guess
        arrays = sorted({re.split(r"[/\[]", name)[0] for name in columns})
        return (
            f"no torques or currents among {', '.join(arrays)}; a log needs them (observation.effort, or a state "
            "with …effort or …current)"
        )
    v = QuantityMap(velocities) if len(velocities) == len(positions) else None
    joints = [_joint(name) for name in positions] if "/" in positions[0] else None
    return Mapping(time, QuantityMap(positions), QuantityMap(torques), v, joints=joints)


def _paired(q: list[str], tau: list[str], v: list[str]) -> tuple[list[str], list[str], list[str]]:
    """The columns of the joints that have a torque, in the order of the positions, where names tell which they are.

    A gripper has a position, and a force or nothing; a state may be in another order than the efforts.
    """
    by_joint = [{_stem(name): name for name in names if "/" in name} for names in (q, tau, v)]
    common = [joint for joint in by_joint[0] if joint in by_joint[1]]
    if not common:
        return q, tau, v
    found = [[names[joint] for joint in common if joint in names] for names in by_joint]
    return found[0], found[1], found[2] or [name for name in v if "/" not in name]


def _of(columns: dict[str, Array], stem: str) -> list[str]:
    return [name for name in columns if name == stem or name.startswith((f"{stem}/", f"{stem}["))]


def _ending(name: str) -> str:
    return name.replace("_", ".").rpartition(".")[2].lower()


def _joint(name: str) -> str:
    entry = name.rpartition("/")[2]
    return entry.rpartition(".")[0] if _ending(entry) in _ENDINGS["q"] and "." in entry else entry


def _stem(name: str) -> str:
    entry = name.rpartition("/")[2]
    ends = [end for endings in _ENDINGS.values() for end in endings]
    return (
        entry[: -len(_ending(entry)) - 1]
        if _ending(entry) in ends and len(_ending(entry)) < len(entry)
        else entry
    )


def _info(path: Path) -> dict[str, Any]:
    folders = [path] if path.is_dir() else list(path.parents)[:4]
    for folder in folders:
        file = folder / "meta" / "info.json"
        if file.is_file():
            found = read_json(file, LogError, "the JSON in which a LeRobot data set describes itself")
            return found if isinstance(found, dict) else {}
    return {}


def _names(value: Any) -> list[str]:
    """The entries of a feature: a list, a list in a list, a list under some key, or a dict of indices."""
    if isinstance(value, dict):
        inner = next(iter(value.values()), None)
        return _names(inner) if isinstance(inner, list) else [str(key) for key in value]
    if isinstance(value, list) and len(value) == 1 and isinstance(value[0], list):
        return _names(value[0])
    return [str(entry) for entry in value] if isinstance(value, list) else []


def _array(column: Any) -> Any:
    import pyarrow
    import pyarrow.compute

    kind = column.type
    if isinstance(kind, pyarrow.ListType | pyarrow.LargeListType | pyarrow.FixedSizeListType):
        if not is_number(kind.value_type):
            return None
        rows = column.combine_chunks()
        lengths = np.asarray(
            pyarrow.compute.list_value_length(rows).fill_null(0).to_numpy(zero_copy_only=False)
        )
        width = int(np.median(lengths)) if len(lengths) else 0
        # a row that is missing, or has too few or too many entries, is no numbers: it is named where it is needed
        whole = lengths == width
        made = np.full((len(rows), width), np.nan)
        made[whole] = rows.filter(whole).flatten().to_numpy(zero_copy_only=False).reshape(-1, width or 1)
        return made if width else None
    return column.to_numpy().astype(np.float64) if is_number(kind) else None
