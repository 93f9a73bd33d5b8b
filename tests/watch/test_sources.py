"""Which logs a fleet has: folders, links, a list on standard input; whose they are, and when they were recorded."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from armloop.cli import main
from armloop.commands import watch as watch_command
from armloop.data.log import read_log, write_log
from armloop.reports.watch_report import _cards
from armloop.util.errors import InputWarning
from armloop.watch import Options, watch
from armloop.watch.history import Head
from armloop.watch.sources import find_logs, recorded_at
from armloop.watch.store import Store
from armloop.watch.verdicts import whole_history

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("stream", ["empty", "closed"])
def test_that_standard_input_names_no_log_is_said(
    fleet: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    stream: str,
) -> None:
    call = ["watch", "--models", str(fleet / "models"), "--logs", "-", "--store", str(tmp_path / "store")]
    with open(os.devnull, encoding="utf-8") as empty:
        monkeypatch.setattr("sys.stdin", empty if stream == "empty" else None)
        assert main(call) == 2
    said = capsys.readouterr().err
    assert "standard input: holds no log" in said and said.count("\n") == 1


def test_a_listed_log_that_is_gone_stops_nothing(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    good = sorted((fleet / "logs" / "healthy").iterdir())[0]
    (tmp_path / "list").write_text(f"{tmp_path / 'gone.csv'}\n{good}\n", encoding="utf-8")
    call = ["watch", "--models", str(fleet / "models"), "--logs", "-", "--store", str(tmp_path / "store")]
    with (tmp_path / "list").open(encoding="utf-8") as listed:
        monkeypatch.setattr("sys.stdin", listed)
        assert main([*call, "--sums-only", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["logs"] == {"read": 1, "known": 0, "set_aside": 1}
    assert "gone.csv: cannot be read (No such file" in answer["set_aside"][0]["reason"]


def test_listed_logs_are_taken_as_many_at_a_time_as_there_are() -> None:
    read, write = os.pipe()
    with os.fdopen(read, encoding="utf-8") as stream:
        os.write(write, b"a.csv\nb.csv\n\nc d.csv\n")
        batches = watch_command._batches(stream)
        assert next(batches) == ["a.csv", "b.csv", "c d.csv"]
        os.write(write, b"e.csv")
        os.close(write)
        assert list(batches) == [["e.csv"]]


def test_recordings_of_other_formats_are_not_passed_over_in_silence(tmp_path: Path) -> None:
    arm = tmp_path / "logs" / "arm7"
    arm.mkdir(parents=True)
    for name in ("a.csv", "b.mcap", "c.csv.gz", "notes.txt", ".hidden.mcap"):
        (arm / name).touch()
    with pytest.warns(InputWarning, match=r"2 files passed over .* such as .*b\.mcap; `armloop convert`"):
        (found,) = find_logs([tmp_path / "logs"])
    assert found.path.name == "a.csv"


def test_a_link_to_a_log_that_is_gone_is_said(fleet: Path, tmp_path: Path) -> None:
    logs = tmp_path / "logs" / "healthy"
    logs.mkdir(parents=True)
    (logs / "gone.csv").symlink_to(tmp_path / "archive" / "gone.csv")
    outcome = watch(fleet / "models", find_logs([logs.parent]), tmp_path / "store")
    assert outcome.counts.aside == 1
    (aside,) = outcome.aside
    assert aside["arm"] == "healthy" and "gone.csv: cannot be read (No such file" in aside["reason"]
    (card,) = [card for card in _cards(outcome) if card.title == "set aside"]
    assert card.figure == "1"


def test_the_folder_of_one_arm_is_taken_for_its_logs(fleet: Path, tmp_path: Path) -> None:
    for of_one in ("healthy", "loaded"):
        (file, *_) = find_logs([fleet / "logs" / of_one])
        outcome = watch(fleet / "models", [file], tmp_path / of_one, Options(full=False))
        assert [arm["arm"] for arm in outcome.arms] == [of_one] and not outcome.aside
    stray = tmp_path / "stray"
    stray.mkdir()
    shutil.copy(file.path, stray)
    outcome = watch(fleet / "models", find_logs([stray]), tmp_path / "store", Options(full=False))
    assert "put it into a folder named after the arm" in outcome.aside[0]["reason"]


def test_links_to_folders_are_followed_once(tmp_path: Path) -> None:
    mounted = tmp_path / "mounted"
    mounted.mkdir()
    (mounted / "a.csv").touch()
    (mounted / "again").symlink_to(mounted)
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "arm7").symlink_to(mounted)
    (found,) = find_logs([logs])
    assert (found.arm, found.path) == ("arm7", logs / "arm7" / "a.csv")


def test_arm_programme_and_warmth_come_from_columns(fleet: Path, tmp_path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    log = read_log(sorted((fleet / "logs" / "healthy").iterdir())[0])
    path = tmp_path / "somewhere" / "log.parquet"
    write_log(path, log)
    table = pyarrow.parquet.read_table(path)
    for name, value in (
        ("arm", "loaded"),
        ("programme", "polish"),
        ("temperature", 31.0),
        ("since_start", 600.0),
    ):
        table = table.append_column(name, pyarrow.array([value] * log.samples))
    pyarrow.parquet.write_table(table, path)
    outcome = watch(fleet / "models", find_logs([tmp_path / "somewhere"]), tmp_path / "store")
    assert [arm["arm"] for arm in outcome.arms] == ["loaded"]
    assert outcome.arms[0]["warmth"] == "temperature"
    history = whole_history(Store(tmp_path / "store"), "loaded", outcome.arms[0]["model"])
    assert [head.programme for head in history.logs] == ["polish"]
    np.testing.assert_allclose(history.units.temperature, 31.0)
    np.testing.assert_allclose(history.units.since_start, 600.0)


def test_when_a_log_was_recorded(tmp_path: Path) -> None:
    day = tmp_path / "2020-01-01" / "fleet" / "arm" / "2025-03-04"
    day.mkdir(parents=True)
    expected = {
        "run_20240131T120530.csv": 1706702730.0,
        "2024-01-31.csv": 1706659200.0,
        "2024-01-31_run-10-20-30.csv": 1706659200.0,
        "20249931.csv": 1741046400.0,  # no date: its folder's
        "14-30-05.csv": 1741046400.0 + 14 * 3600 + 30 * 60 + 5,
        "run_143005.csv": 1741046400.0 + 14 * 3600 + 30 * 60 + 5,
        "run_14_31.csv": 1741046400.0,
        "run_256199.csv": 1741046400.0,
    }
    for name in expected:
        (day / name).touch()
    found = {file.path.name: file for file in find_logs([tmp_path / "2020-01-01" / "fleet"])}
    assert {name: recorded_at(file, 0.0) for name, file in found.items()} == expected
    assert recorded_at(found["2024-01-31.csv"], 1.7e9) == 1.7e9
    # what the fleet is kept in says nothing of its logs
    bare = day.parent / "run.csv"
    bare.touch()
    os.utime(bare, (1.6e9, 1.6e9))
    for place in (tmp_path / "2020-01-01" / "fleet", bare):
        (file,) = [each for each in find_logs([place]) if each.path == bare]
        assert recorded_at(file, 0.0) == 1.6e9


def test_logs_of_one_moment_are_in_natural_order() -> None:
    names = ["run10", "run2", "run02b", "run", "2", "Run1", "run2b"]
    heads = [Head(1.0, name, "", "", Path()) for name in names]
    assert [head.name for head in sorted(heads)] == ["2", "Run1", "run", "run2", "run02b", "run2b", "run10"]
    assert Head(0.5, "run10", "", "", Path()) < heads[0] and heads[0] >= heads[1]
    assert sorted([Head(1.0, "run2", log, "", Path()) for log in "ba"])[0].log == "a"
