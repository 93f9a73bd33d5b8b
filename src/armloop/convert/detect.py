"""Format detection: which reader a source belongs to, by its name and what it holds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from armloop.convert.lerobot import is_lerobot, read_lerobot
from armloop.convert.libfranka import is_libfranka, read_libfranka
from armloop.convert.matlab import read_matlab
from armloop.convert.numpy_archive import read_npz
from armloop.convert.recording import Recording
from armloop.convert.rosbag import read_rosbag
from armloop.convert.rtde import is_rtde, read_rtde
from armloop.convert.table import read_table
from armloop.convert.text import header_of
from armloop.data.tables import check_name, other_kind
from armloop.util.errors import LogError

KNOWN = (
    "a ROS bag (folder, .db3, .mcap, .bag), an RTDE or libfranka CSV, a LeRobot data set, .mat, .npz, "
    "or a table (.csv, .tsv, .txt, .parquet)"
)


def read_source(path: Path, topic: str | None = None, wanted: Sequence[str] | None = None) -> Recording:
    """Read one source; raises ``LogError`` where it is missing, of no known format, or broken."""
    if not path.exists():
        raise LogError(f"{path}: no such file; give {KNOWN}")
    suffix = path.suffix.lower()
    if not (path.is_file() or path.is_dir()):
        raise LogError(f"{path}: is a device or a pipe; give {KNOWN}")
    if suffix == ".parquet":
        check_name(path)
    try:
        if suffix in (".db3", ".mcap", ".bag") or (path.is_dir() and (path / "metadata.yaml").is_file()):
            return read_rosbag(path, topic, wanted)
        if topic is not None:
            raise LogError(f"{path}: --topic belongs to ROS bags")
        if path.is_dir() or suffix == ".parquet":
            if is_lerobot(path):
                return read_lerobot(path)
            if path.is_dir():
                bags = sorted(path.glob("*.db3")) + sorted(path.glob("*.mcap"))
                alone = f"; give {bags[0]} itself" if bags else ""
                raise LogError(
                    f"{path}: a folder with neither metadata.yaml (a ROS 2 bag) nor meta/info.json (LeRobot){alone}"
                )
            return read_table(path)
        if suffix == ".mat":
            return read_matlab(path)
        if suffix == ".npz":
            return read_npz(path)
        if suffix in (".csv", ".tsv", ".txt", ".log", ".dat"):
            header = header_of(path)
            if is_rtde(header):
                return read_rtde(path)
            return read_libfranka(path) if is_libfranka(header) else read_table(path)
        if kind := other_kind(path):
            raise LogError(f"{path}: {kind}")
    except OSError as error:
        raise LogError(
            f"{path}: cannot be read ({error.strerror or error}); check its permissions"
        ) from error
    raise LogError(f"{path}: unknown format {path.suffix!r}; give {KNOWN}")
