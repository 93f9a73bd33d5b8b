"""Files with one thing wrong, and what every command must answer to them."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from armloop.cli import main

Lines = list[list[str]]


def log_with(change: Callable[[Lines], object]) -> Callable[[Path, Path], str]:
    """A bad log: the good one, its cells changed; row 0 is the header, column 0 the time, 1-3 q, 4-6 v, 7-9 tau."""

    def make(inputs: Path, folder: Path) -> str:
        lines = [line.split(",") for line in (inputs / "good.csv").read_text().splitlines()]
        change(lines)
        path = folder / "bad.csv"
        path.write_text("\n".join(",".join(line) for line in lines) + "\n")
        return str(path)

    return make


def cell(row: int, column: int, text: str) -> Callable[[Path, Path], str]:
    return log_with(lambda lines: lines[row].__setitem__(column, text))


def text_file(name: str, content: str) -> Callable[[Path, Path], str]:
    def make(inputs: Path, folder: Path) -> str:
        (folder / name).write_text(content)
        return str(folder / name)

    return make


def model_with(change: Callable[[dict], object]) -> Callable[[Path, Path], str]:
    def make(inputs: Path, folder: Path) -> str:
        data = json.loads((inputs / "model.json").read_text())
        change(data)
        return text_file("bad.json", json.dumps(data))(inputs, folder)

    return make


def given(name: str) -> Callable[[Path, Path], str]:
    return lambda inputs, folder: str(inputs / name)


def urdf(body: str) -> Callable[[Path, Path], str]:
    return text_file("bad.urdf", body)


LINK = "<link name='{}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
LINK += "</inertial></link>"
JOINT = "<joint name='{}' type='{}'><parent link='{}'/><child link='{}'/><axis xyz='0 0 1'/>"
JOINT += "<limit lower='-1' upper='1' velocity='1' effort='1'/></joint>"


def links(*names: str) -> str:
    return "".join(LINK.format(name) for name in names)


def joints(*joints: tuple[str, str, str, str]) -> str:
    return "".join(JOINT.format(*joint) for joint in joints)


GOOD, MODEL, OUT = given("good.csv"), given("model.json"), "OUT"
CLUSTER = ("cluster",)
EVALUATE = ("evaluate", MODEL)
DIAGNOSE = ("diagnose", MODEL)
RECONSTRUCT = ("reconstruct", "--arm", "three_axis", "--out", "OUT/model.json")
TRACK = ("track", "three_axis_tracking", "--out", OUT)


def scenario(content: str) -> Callable[[Path, Path], str]:
    return text_file("bad.yaml", content)


def listing(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()} | {
        f"{p.relative_to(folder)}/": b"" for p in folder.rglob("*") if p.is_dir()
    }


def arguments_of(parts: tuple[object, ...], inputs: Path, folder: Path) -> list[str]:
    """The arguments with their files made; OUT is a folder that does not exist yet."""
    arguments = []
    for part in parts:
        text = part(inputs, folder) if callable(part) else str(part)
        text = text.replace("MODEL", str(inputs / "model.json")) if "=" in text else text
        arguments.append(text.replace("OUT", str(folder / "out")) if text.startswith("OUT") else text)
    return arguments


def answered(
    parts: tuple[object, ...], expected: str, inputs: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Check that a fault is answered with one line and status 2, and leaves nothing behind."""
    arguments = [a.replace("SCARA", str(inputs / "scara.json")) for a in arguments_of(parts, inputs, folder)]
    before = listing(folder), listing(inputs)
    status = main(arguments)
    answer = capsys.readouterr()
    assert status == 2
    assert answer.err.startswith("armloop: ") and answer.err.count("\n") == 1 and answer.err.endswith("\n")
    assert re.search(expected, answer.err), answer.err
    assert "Traceback" not in answer.err + answer.out
    assert (listing(folder), listing(inputs)) == before
