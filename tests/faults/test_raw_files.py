"""What is no JSON, no file, or has a name that no file can have: one line, status 2."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from faults.conftest import LONG, one_line

from armloop.cli import main

DEEP = "[" * 100_000
RAW: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", r"not JSON \(line 1"),
    "a formula": (b"tau1 = 3*q1\n", r"not JSON \(line 1"),
    "half": (b'{"schema": "armloop/model/2",\n', r"not JSON \(line 2"),
    "a list": (b"[1, 2]", "schema is None"),
    "a number": (b"3", "schema is None"),
    "null": (b"null", "schema is None"),
    "no text": (b"\xff\xfe\x00", "is no UTF-8"),
    "zeros": (bytes(100), "not JSON"),
    "lists within lists": (DEEP.encode(), "too deep"),
    "objects within objects": (b'{"a":' * 50_000, "too deep"),
    "an integer of 400 digits": (f'{{"schema": {LONG}}}'.encode(), "a number of 400 digits"),
    "a fraction of 400 digits": (f'{{"schema": 0.{LONG}}}'.encode(), "not a finite number"),
    "a large exponent": (b'{"schema": 1e999}', "not a finite number"),
    "NaN": (b'{"schema": NaN}', "NaN is not a finite number"),
    "infinity": (b'{"schema": -Infinity}', "-Infinity is not a finite number"),
    "a key twice": (b'{"schema": 1, "schema": 2}', "field 'schema' stands twice"),
    "a key twice within": (b'{"schema": {"a": 1, "b": 2, "a": 3}}', "field 'a' stands twice"),
    "two values": (b"{} {}", "not JSON"),
    "a pickle": (b"\x80\x04N.", "no UTF-8|not JSON"),
}


@pytest.mark.parametrize("name", RAW)
def test_what_is_no_model(name: str, right: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, said = RAW[name]
    (tmp_path / "bad.json").write_bytes(content)
    assert main(["evaluate", str(tmp_path / "bad.json"), str(right / "run.csv")]) == 2
    one_line(capsys.readouterr().err, rf"bad\.json: .*({said})|bad\.json: {said}")


def fifo(path: Path) -> None:
    os.mkfifo(path)


def folder(path: Path) -> None:
    path.mkdir()


def large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 33)


def circle(path: Path) -> None:
    path.symlink_to(path)


PLACES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a pipe": (fifo, "is a device or a pipe"),
    "a folder": (folder, "is a folder"),
    "eight gigabytes": (large, "has 8589934592 bytes"),
    "a link to itself": (circle, "cannot be read"),
    "nothing": (lambda path: None, "no such file"),
    "a link to the null device": (lambda path: path.symlink_to("/dev/null"), "is a device"),
    "a link to endless zeros": (lambda path: path.symlink_to("/dev/zero"), "is a device"),
}
READERS = {"a model": ("evaluate", "run.csv"), "a scenario": ("track", "")}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", PLACES)
def test_what_is_no_file(
    name: str, reader: str, right: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, said = PLACES[name]
    command, log = READERS[reader]
    make(tmp_path / "bad.json")
    words = [command, str(tmp_path / "bad.json"), *([str(right / log)] if log else [])]
    assert main(words) == 2
    one_line(capsys.readouterr().err, f"{said}|no such scenario")


@pytest.mark.parametrize(
    "name", ["m" * 300 + ".json", "model\x00.json", "m/" * 3000 + "m", "model\udcff.json"], ids=range(4)
)
def test_names_that_no_file_can_have(name: str, right: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["evaluate", name, str(right / "run.csv")], ["track", name], ["tune", name]):
        assert main(words) == 2
        answer = capsys.readouterr().err
        assert answer.startswith("armloop: ") and answer.count("\n") == 1, answer
