"""Packaged resources: where the arms and scenarios that come with armloop lie on the disk.

In a source checkout they are the top-level folders `urdf/` and `scenarios/`; in a wheel the same folders are
packed inside the package. Both are found by walking from this file, so no build step is needed to edit them.
"""

from pathlib import Path

from armloop.util.errors import ArmError, InputError, ScenarioError
from armloop.util.given import path_of

_PARTS = ("plants", "collection")  # YAML files that scenarios and collections draw on
_PACKAGE = Path(__file__).resolve().parents[1]


def urdf_path(name: str) -> Path:
    """The URDF file of a built-in arm (`three_axis`, `scara`); raises `ArmError`, which lists them, for another name."""
    return _find("urdf", ".urdf", name, "arm", ArmError)


def measured_folder(name: str) -> Path:
    """The folder of measured logs that come with armloop (`ur5`), with licence and source; raises `InputError`."""
    folder = _folder("scenarios") / "measured" / name
    if folder.is_dir():
        return folder
    raise InputError(f"{name}: no measured logs of that name come with armloop; there are: ur5")


def scenario_path(name: str) -> Path:
    """The YAML file of a built-in scenario; raises `ScenarioError`, which lists them, for another name."""
    return _find("scenarios", ".yaml", name, "scenario", ScenarioError)


def find_scenario(spec: str | Path) -> tuple[Path, str | None]:
    """The file of a scenario (a built-in name, FILE) and its name in it (FILE:NAME); raises `ScenarioError`."""
    spec = str(path_of(spec, "the scenario", ScenarioError))
    file, colon, name = spec.rpartition(":")
    if not colon or Path(spec).is_file():
        file, name = spec, ""
    path = scenario_path(file) if file in scenario_names() else Path(file)
    if not path.is_file():
        known = ", ".join(each for each in scenario_names() if each not in _PARTS)
        raise ScenarioError(f"{path}: no such scenario; give the path of a YAML file or one of: {known}")
    return path, name or None


def urdf_names() -> list[str]:
    """The names of the built-in arms, sorted."""
    return _names("urdf", ".urdf")


def scenario_names() -> list[str]:
    """The names of the built-in scenarios, sorted."""
    return _names("scenarios", ".yaml")


def _folder(kind: str) -> Path:
    """The folder `kind`: inside the package (wheel), else beside `src` (checkout)."""
    packed = _PACKAGE / kind
    return packed if packed.is_dir() else _PACKAGE.parents[1] / kind


def _names(kind: str, suffix: str) -> list[str]:
    return sorted(path.stem for path in _folder(kind).glob(f"*{suffix}"))


def _find(kind: str, suffix: str, name: str, what: str, error: type[InputError]) -> Path:
    names = _names(kind, suffix)
    if name not in names:
        known = ", ".join(names) or "none: this installation is incomplete"
        raise error(f"{name!r}: no built-in {what} of this name; there are: {known}")
    return _folder(kind) / f"{name}{suffix}"
