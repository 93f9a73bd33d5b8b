"""The exported C file compiled by the machine's own compiler and called: what its consumer will see."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from armloop.util.arrays import Array
from armloop.util.errors import InputError

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-O2")


def compiler() -> str | None:
    """The C compiler at hand, or None."""
    return next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))), None)


class CompiledTorque:
    """The functions of a compiled file, on arrays of samples (N, n)."""

    def __init__(self, source: Path) -> None:
        """Compile; raises ``InputError`` with the compiler's first complaint."""
        program = compiler()
        if program is None:
            raise InputError("no C compiler is at hand (cc, gcc or clang)")
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "armloop_export.so"
            done = subprocess.run(
                [program, *FLAGS, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"],
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode:
                raise InputError(f"{source}: the compiler refuses it: {done.stderr.strip().splitlines()[:1]}")
            self._library = ctypes.CDLL(str(library))
        self._torque = self._library.armloop_torque

    def torque(self, q: Array, v: Array, vdot: Array) -> Array:
        """(N, n) torques, sample by sample."""
        return _each(self._torque, q, v, vdot)

    def remembered(self, q: Array, v: Array, vdot: Array) -> Array:
        """(N, n) torques of one run in order of time, with the memory relaxed before it; time itself is not set."""
        # Larger than any struct that the file declares.
        memory = ctypes.create_string_buffer(1 << 16)
        self._library.armloop_reset(memory)
        call = self._library.armloop_torque_memory
        return _each(lambda *pointers: call(memory, *pointers), q, v, vdot)


def _each(call: Callable[..., object], q: Array, v: Array, vdot: Array) -> Array:
    pointer = ctypes.POINTER(ctypes.c_double)
    q, v, vdot = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, v, vdot))
    tau = np.full_like(q, np.nan)
    for rows in zip(q, v, vdot, tau, strict=True):
        call(*(row.ctypes.data_as(pointer) for row in rows))
    return tau
