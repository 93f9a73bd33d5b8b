"""Writing a model for another tool, reading it back as that tool does, and comparing the torques."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from armloop.data.motion import Motion
from armloop.export.c_code import c_source
from armloop.export.drake_bundle import as_drake
from armloop.export.exported import NAMES, Exported, rms_of, whole_torque
from armloop.export.expressible import Said, random_motion, said
from armloop.export.mjcf import FEATURES as MJCF_FEATURES
from armloop.export.mjcf import mjcf_text
from armloop.export.reading_c import CompiledTorque, compiler
from armloop.export.robot_xml import SDF_FEATURES, URDF_FEATURES, sdf_text, urdf_text
from armloop.export.round_trip import NotInstalled, drake_torque, mujoco_torque
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array
from armloop.util.errors import InputError, ModelError
from armloop.util.files import write_text
from armloop.util.given import path_of

TARGETS = ("urdf", "sdf", "mjcf", "drake", "c")
_SAMPLES = 400


def export(
    model: ReconstructedModel, target: str, path: str | Path, motion: Motion | None = None
) -> Exported:
    """Write a model for another tool and read it back.

    Args:
        target: one of :data:`TARGETS`; ``drake`` writes a folder, the others one file.
        motion: the states to compare at; random ones within the training range by default, none of them at rest.

    Raises:
        InputError: the target is unknown, or the place cannot be written to or has another target's name.
        ModelError: the model cannot be said in this form at all.
    """
    path = path_of(path, "the path of an export")
    if not isinstance(target, str) or target not in TARGETS:
        raise InputError(f"--to {target}: unknown; it must be one of {', '.join(TARGETS)}")
    others = [each for each, suffix in _SUFFIX.items() if suffix == path.suffix.lower() and each != target]
    if others:
        raise InputError(
            f"{path}: ends in {path.suffix}, by which readers take it for {others[0]}; "
            f"give another name, or --to {others[0]}"
        )
    if model.in_amperes and target != "c":
        raise ModelError(
            f"the model predicts motor currents in A; {target} needs torques: reconstruct it with --drive-gains"
        )
    motion = random_motion(model, _SAMPLES, seed=4) if motion is None else motion
    if target == "c":
        return _as_c(model, path, motion)
    if target == "drake":
        return as_drake(model, path, motion)
    return _described(model, target, path, motion)


def _described(model: ReconstructedModel, target: str, path: Path, motion: Motion) -> Exported:
    template, features, consumer, read = _FORMATS[target]
    what = said(model)
    notes = [*what.notes, NAMES]
    names = model.arm.joint_names
    whole = whole_torque(model, motion)
    difference = unsaid = None
    source = template(what)
    # The consumers know a format by its name's end.
    with _draft(source, f"arm{_SUFFIX[target]}") as place:
        try:
            tau = read(place, names, motion.q, motion.v, motion.vdot)
        except NotInstalled as error:
            consumer = ""
            notes.append(str(error))
        except (RuntimeError, ValueError) as error:  # how Drake and MuJoCo refuse a file
            why = str(error).replace(f"{place.parent}/", "")
            raise ModelError(f"{consumer} does not read the {target} of this model: {why}") from error
        else:
            difference = np.abs(tau - what.torque(motion.q, motion.v, motion.vdot, features)).max(axis=0)
            unsaid = np.abs(tau - whole).max(axis=0)
    write_text(path, source)
    return Exported(target, [path], consumer, rms_of(whole), difference, unsaid, what.lost(features), notes)


def _as_c(model: ReconstructedModel, path: Path, motion: Motion) -> Exported:
    source, found = c_source(model)
    notes = []
    whole = whole_torque(model, motion)
    difference, program = None, compiler()
    if program is None:
        notes.append("no C compiler is at hand (cc, gcc or clang): the file was written, not compiled")
    else:
        with _draft(source, "arm.c") as place:
            tau = CompiledTorque(place).torque(motion.q, motion.v, motion.vdot)
        difference = np.abs(tau - whole).max(axis=0)
    write_text(path, source)
    if found.has_memory:
        notes.append(
            "armloop_torque_memory carries friction's memory and clock along in a struct; armloop_torque has it fully "
            "slid and warm"
        )
    consumer = Path(program or "").name
    return Exported("c", [path], consumer, rms_of(whole), difference, difference, found.left_out, notes)


@contextmanager
def _draft(source: str, name: str) -> Iterator[Path]:
    """A file of this name for its consumer: what that refuses is not written."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / name
        place.write_text(source, encoding="utf-8")
        yield place


_SUFFIX = {"urdf": ".urdf", "sdf": ".sdf", "mjcf": ".xml"}
_Reader = Callable[[Path, Sequence[str], Array, Array, Array], Array]
_FORMATS: dict[str, tuple[Callable[[Said], str], frozenset[str], str, _Reader]] = {
    "urdf": (urdf_text, URDF_FEATURES, "Drake", drake_torque),
    "sdf": (sdf_text, SDF_FEATURES, "Drake", drake_torque),
    "mjcf": (mjcf_text, MJCF_FEATURES, "MuJoCo", mujoco_torque),
}
