"""The models of a fleet: which arm is watched against which."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from armloop.model import ReconstructedModel, load_model
from armloop.monitoring.catalogue import watched
from armloop.util.errors import InputError


def find_models(place: str | Path) -> dict[str, Path]:
    """Model files by arm: DIR/ARM.json or DIR/ARM/model.json; a single file serves every arm, as ``""``.

    Raises:
        InputError: there is none.
    """
    place = Path(place)
    if place.is_file():
        return {"": place}
    found = {path.stem: path for path in sorted(place.glob("*.json"))}
    found |= {path.parent.name: path for path in sorted(place.glob("*/model.json"))}
    if not found:
        raise InputError(
            f"{place}: holds no model; --models takes a folder with ARM.json or ARM/model.json, or one model file"
        )
    return found


def model_for(models: dict[str, Path], arm: str) -> Path | None:
    """The model of an arm, or None."""
    return models.get(arm, models.get(""))


def model_and_digest(path: Path) -> tuple[ReconstructedModel, str]:
    """A model, and 12 hexadecimal digits of its file and of the columns that are kept for it; read anew once it is replaced.

    Sums against another model, or with other columns, do not add to these.

    Raises:
        InputError: the model cannot be read, or predicts currents.
    """
    state = path.stat() if path.exists() else None
    return _read(path, state and (state.st_ino, state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=4)
def _read(path: Path, state: tuple[int, int, int] | None) -> tuple[ReconstructedModel, str]:
    model = load_model(path)
    model.require_torques(f"{path}:")
    digest = hashlib.sha256(path.read_bytes())
    for effect, shape in watched(model):
        digest.update(f"{effect.label()} {shape!r}\n".encode())
    return model, digest.hexdigest()[:12]
