"""NumPy archives (``numpy.savez``): arrays (N,), (N, n) or (n, N). Nothing is ever unpickled."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from armloop.convert.matlab import from_arrays
from armloop.convert.recording import Recording
from armloop.util.errors import LogError


def read_npz(path: Path) -> Recording:
    """Read all numeric arrays; raises ``LogError`` for what is none, or holds Python objects."""
    arrays: dict[str, Any] = {}
    objects = []
    try:
        with np.load(path, allow_pickle=False) as content:
            for name in content.files:
                try:
                    arrays[name] = content[name]
                except ValueError:
                    objects.append(name)
    except MemoryError as error:  # what an array's header claims, whatever the file has
        raise LogError(f"{path}: holds more than there is memory for; write its parts one by one") from error
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise LogError(f"{path}: no NumPy archive ({error}); write one with numpy.savez") from error
    recording = from_arrays(path, "NumPy archive", arrays)
    if objects:
        recording.notes.append(f"Python objects are never read, left out: {', '.join(objects)}")
    return recording
