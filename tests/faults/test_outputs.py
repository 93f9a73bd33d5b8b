"""Outputs never replace what is read, a device, or a file of somebody else; they are whole or absent."""

import fcntl
import json
import os
import re
import stat
import time
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.synchronize import Event
from pathlib import Path

import pytest
from faults.conftest import contents

from armloop.cli import main
from armloop.model import load_model
from armloop.util import outputs
from armloop.util.errors import InputError
from armloop.util.files import replacing, strict, write_json, write_text

Place = Path
RECONSTRUCT = "reconstruct run.csv --arm arm.urdf --library rigid-body"
DIAGNOSE = "diagnose model.json run.csv"
EXCITE = "excite three_axis --library rigid-body --starts 1 --random 2"
TRACK = "track scenario.yaml"


def somebody(*names: str) -> Callable[[Place], None]:
    """Files that a person has laid there."""

    def lay(place: Place) -> None:
        for name in names:
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_text("mine")

    return lay


def link(name: str, to: str) -> Callable[[Place], None]:
    return lambda place: (place / name).symlink_to(place / to)


def nothing(place: Place) -> None:
    pass


def full_of_armloops(name: str) -> Callable[[Place], None]:
    """A file with the mark of another command."""

    def lay(place: Place) -> None:
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(json.dumps({"schema": "armloop/model/1", "written_by": "armloop diagnose"}))

    return lay


READ, THERE, DEVICE = "is read by this command", "has not written it", "is a device or a pipe"
NO_ROOM = r"cannot be written to; choose another folder for --(report|next-run)"
# what lies there, the command, what its one line says
REFUSED: dict[str, tuple[Callable[[Place], None], str, str]] = {
    "reconstruct: out is the log": (nothing, f"{RECONSTRUCT} --out run.csv", READ),
    "reconstruct: out is the URDF": (nothing, f"{RECONSTRUCT} --out arm.urdf", READ),
    "reconstruct: report is the log": (nothing, f"{RECONSTRUCT} --out m.json --report run.csv", READ),
    "reconstruct: report is the URDF": (nothing, f"{RECONSTRUCT} --out m.json --report arm.urdf", READ),
    "reconstruct: the log by a link": (link("l.json", "run.csv"), f"{RECONSTRUCT} --out l.json", READ),
    "reconstruct: the log by another way": (nothing, f"{RECONSTRUCT} --out ../{{here}}/run.csv", READ),
    "reconstruct: a hard link to the log": (
        lambda place: os.link(place / "run.csv", place / "hard.json"),
        f"{RECONSTRUCT} --out hard.json",
        READ,
    ),
    "reconstruct: somebody's file": (somebody("notes.json"), f"{RECONSTRUCT} --out notes.json", THERE),
    "reconstruct: somebody's page": (
        somebody("a.html"),
        f"{RECONSTRUCT} --out m.json --report a.html",
        THERE,
    ),
    "reconstruct: a model by Python": (nothing, f"{RECONSTRUCT} --out model.json", THERE),
    "reconstruct: a diagnosis' model": (full_of_armloops("m.json"), f"{RECONSTRUCT} --out m.json", THERE),
    "reconstruct: the null device": (nothing, f"{RECONSTRUCT} --out /dev/null", DEVICE),
    "reconstruct: the null device, forced": (nothing, f"{RECONSTRUCT} --out /dev/null --force", DEVICE),
    "reconstruct: a report on the null device": (
        nothing,
        f"{RECONSTRUCT} --out m.json --report /dev/null",
        DEVICE,
    ),
    "reconstruct: a pipe": (lambda place: os.mkfifo(place / "pipe"), f"{RECONSTRUCT} --out pipe", DEVICE),
    "reconstruct: a folder": (nothing, f"{RECONSTRUCT} --out .", "is a folder; --out must name a file"),
    "reconstruct: a folder for the report": (
        nothing,
        f"{RECONSTRUCT} --out m.json --report .",
        "is a folder; --report must name a file",
    ),
    "reconstruct: below a file": (nothing, f"{RECONSTRUCT} --out run.csv/m.json", "run.csv: is a file"),
    "reconstruct: a name too long": (
        nothing,
        f"{RECONSTRUCT} --out {'m' * 300}.json",
        "longer than 255|too long",
    ),
    "reconstruct: a circle of links": (
        lambda place: (place / "me.json").symlink_to(place / "me.json"),
        f"{RECONSTRUCT} --out me.json",
        "cannot be written",
    ),
    "reconstruct: a report where nothing can be made": (
        nothing,
        f"{RECONSTRUCT} --out m.json --report /proc/r.html",
        NO_ROOM,
    ),
    "excite: a report where nothing can be made": (
        nothing,
        f"{EXCITE} --out r.csv --report /proc/r.html",
        NO_ROOM,
    ),
    "diagnose: a next run where nothing can be made": (
        nothing,
        f"{DIAGNOSE} --out d --next-run /proc/n.csv",
        NO_ROOM,
    ),
    "watch: a report where nothing can be made": (
        nothing,
        "watch --models model.json --logs run.csv --store s --report /proc/r.html",
        NO_ROOM,
    ),
    "watch: a model that is none": (
        nothing,
        "watch --models arm.urdf --logs run.csv --store s",
        r"arm\.urdf: ",
    ),
    "diagnose: out is the model's folder": (nothing, f"{DIAGNOSE} --out .", r"model\.json: is read"),
    "diagnose: somebody's report": (somebody("d/report.html"), f"{DIAGNOSE} --out d", THERE),
    "diagnose: somebody's diagnosis": (somebody("d/diagnosis.json"), f"{DIAGNOSE} --out d", THERE),
    "diagnose: next run is the log": (nothing, f"{DIAGNOSE} --out d --next-run run.csv", READ),
    "diagnose: next run is a held-out log": (
        nothing,
        f"{DIAGNOSE} --held-out other.csv --out d --next-run other.csv",
        READ,
    ),
    "diagnose: next run is somebody's log": (nothing, f"{DIAGNOSE} --out d --next-run other.csv", THERE),
    "diagnose: out is a file": (
        nothing,
        f"{DIAGNOSE} --out run.csv",
        "run.csv: is a file; --out must name a folder",
    ),
    "diagnose: out is a device": (
        nothing,
        f"{DIAGNOSE} --out /dev/null",
        "is a file; --out must name a folder",
    ),
    "diagnose: wrong duration": (
        nothing,
        f"{DIAGNOSE} --out d --next-run n.csv --next-run-duration 3",
        "next run of 3 s",
    ),
    "diagnose: endless duration": (
        nothing,
        f"{DIAGNOSE} --out d --next-run n.csv --next-run-duration inf",
        "next run of inf s",
    ),
    "diagnose: duration no number": (
        nothing,
        f"{DIAGNOSE} --out d --next-run n.csv --next-run-duration nan",
        "next run of nan s",
    ),
    "diagnose: wrong reserve": (nothing, f"{DIAGNOSE} --out d --next-run n.csv --reserve 1.5", "reserve 1.5"),
    "diagnose: negative reserve": (
        nothing,
        f"{DIAGNOSE} --out d --next-run n.csv --reserve -0.1",
        "reserve -0.1",
    ),
    "diagnose: no motion within the effort": (
        nothing,
        f"{DIAGNOSE} --out d --next-run n.csv --reserve 0.9999",
        "effort",
    ),
    "collect: where measured logs lie": (
        somebody("logs/varying.csv"),
        "collect three_axis --out logs",
        THERE,
    ),
    "collect: where a static log lies": (somebody("logs/static.csv"), "collect arm.urdf --out logs", THERE),
    "collect: where another command's log lies": (
        somebody("logs/constant_velocity.csv", "logs/.armloop"),
        "collect three_axis --plan simulation --out logs",
        THERE,
    ),
    "collect: below a file": (nothing, "collect three_axis --out run.csv/logs", "run.csv: is a file"),
    "excite: out is the model": (
        lambda place: (place / "m.csv").symlink_to(place / "model.json"),
        f"{EXCITE} --model model.json --out m.csv",
        READ,
    ),
    "excite: somebody's log": (nothing, f"{EXCITE} --out run.csv", THERE),
    "excite: report is the model": (
        nothing,
        f"{EXCITE} --out r.csv --model model.json --report model.json",
        READ,
    ),
    "excite: a device": (nothing, f"{EXCITE} --out /dev/null", DEVICE),
    "track: somebody's plot": (somebody("t/tracking.png"), f"{TRACK} --out t", THERE),
    "track: somebody's answer": (somebody("t/tracking.json"), f"{TRACK} --out t", THERE),
    "track: a model read there": (
        nothing,
        "track scenario.yaml --model step3=model.json --out .",
        r"model\.json: is read",
    ),
    "tune: somebody's answer": (somebody("t/tune.json"), "tune three_axis_tracking --out t", THERE),
    "loop: somebody's log": (somebody("l/logs/second_run.csv"), "loop --out l", THERE),
    "loop: somebody's model": (somebody("l/model.json"), "loop --out l", THERE),
    "reproduce: somebody's answer": (somebody("r/reproduction.json"), "reproduce table2 --out r", THERE),
    "reproduce: below a file": (nothing, "reproduce table2 --out run.csv/r", "run.csv: is a file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_to_be_replaced_stays(case: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lay, command, expected = REFUSED[case]
    lay(place)
    before, folders = contents(place), sorted(place.rglob("*"))
    device = os.stat("/dev/null")
    status = main(command.replace("{here}", place.name).split())
    answer = capsys.readouterr()
    assert status == 2
    assert answer.err.startswith("armloop: ") and answer.err.count("\n") == 1, answer.err
    assert re.search(expected, answer.err), answer.err
    assert contents(place) == before and sorted(place.rglob("*")) == folders
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode) and os.stat("/dev/null").st_rdev == device.st_rdev


def writer(path: str, force: bool = False, command: str = "reconstruct", reads: tuple[str, ...] = ()) -> None:
    with outputs.guarding(command, reads, force):
        if path.endswith(".json"):
            write_json(path, {"schema": "armloop/model/1", "value": 1})
        else:
            write_text(
                path, "<!doctype html><html><head></head></html>" if path.endswith("html") else f"{command}\n"
            )


@pytest.mark.parametrize("name", ["a.json", "a.html", "a.csv", "a.urdf"])
def test_a_command_replaces_what_it_has_written_itself(name: str, place: Path) -> None:
    writer(name)
    writer(name)
    with pytest.raises(InputError, match="`armloop excite` has not written it"):
        writer(name, command="excite")
    writer(name, command="excite", force=True)
    with pytest.raises(InputError, match="`armloop reconstruct` has not written it"):
        writer(name)


def test_a_table_that_was_changed_is_nobodys(place: Path) -> None:
    writer("a.csv")
    (place / "a.csv").write_text("3,4\n")
    with pytest.raises(InputError, match="has not written it"):
        writer("a.csv")


def test_force_replaces_what_is_read(place: Path) -> None:
    with pytest.raises(InputError, match="is read"):
        writer("run.csv", reads=("run.csv",))
    writer("run.csv", force=True, reads=("run.csv",))
    assert (place / "run.csv").read_text() == "reconstruct\n"


def test_links_are_followed_and_stay(place: Path) -> None:
    (place / "far").mkdir()
    (place / "a.json").symlink_to(place / "far" / "b.json")
    writer("a.json")
    assert (place / "a.json").is_symlink() and (place / "far" / "b.json").is_file()
    writer("a.json")


def test_permissions_are_those_of_the_file_or_of_a_new_one(place: Path) -> None:
    before = os.umask(0o027)
    try:
        writer("a.json")
    finally:
        os.umask(before)
    assert stat.S_IMODE((place / "a.json").stat().st_mode) == 0o640
    (place / "a.json").chmod(0o604)
    writer("a.json")
    assert stat.S_IMODE((place / "a.json").stat().st_mode) == 0o604


def test_a_draft_is_new_and_its_name_cannot_be_guessed(place: Path) -> None:
    names = set()
    for _ in range(3):
        with replacing(place / "a.csv") as draft:
            assert draft.parent == place and draft.stat().st_size == 0
            names.add(draft.name)
            draft.write_text("1\n")
    assert len(names) == 3
    assert not [path for path in place.iterdir() if path.name.endswith(".part")]


def test_drafts_of_killed_processes_are_removed_and_those_in_use_stay(place: Path) -> None:
    abandoned = place / ".a.csv.0123456789abcdef.part"
    abandoned.write_text("half")
    with replacing(place / "a.csv") as held:
        held.write_text("1\n")
        with replacing(place / "a.csv") as other:
            other.write_text("2\n")
        assert held.exists() and not abandoned.exists()
    assert (place / "a.csv").read_text() == "1\n"


def test_an_error_on_the_way_leaves_the_earlier_file(place: Path) -> None:
    writer("a.json")
    before = contents(place)
    with pytest.raises(ZeroDivisionError), replacing(place / "a.json") as draft:
        draft.write_text("half")
        raise ZeroDivisionError
    assert contents(place) == before


def test_a_file_that_comes_while_the_command_works_stays(place: Path) -> None:
    with outputs.guarding("reconstruct"), pytest.raises(InputError, match="has not written it"):
        with replacing(place / "a.csv") as draft:
            draft.write_text("1\n")
            (place / "a.csv").write_text("mine")
    assert (place / "a.csv").read_text() == "mine"


def test_a_folder_in_use_says_so(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "d").mkdir()
    held = os.open(place / "d", os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_EX)
    try:
        for command in (
            f"{DIAGNOSE} --out d",
            "collect three_axis --out d",
            f"{TRACK} --out d",
            "loop --out d",
        ):
            assert main(command.split()) == 2
            assert "another run writes into this folder" in capsys.readouterr().err
    finally:
        os.close(held)


def _linger(begun: Event) -> None:
    begun.set()
    time.sleep(60)


def test_a_worker_that_outlives_its_command_holds_no_folder(place: Path) -> None:
    """As one does for a moment whose command was killed: the next run need not wait for it."""
    for name in "de":
        (place / name).mkdir()
    with outputs.guarding("loop"):
        outputs.take_folder(place / "d")
        with outputs.guarding("track"):
            outputs.take_folder(place / "e")
            begun = get_context("fork").Event()
            worker = get_context("fork").Process(target=_linger, args=(begun,))
            worker.start()
            assert begun.wait(60)
    try:
        with outputs.guarding("loop"):
            outputs.take_folder(place / "d")
            outputs.take_folder(place / "e")
    finally:
        worker.kill()
        worker.join()


def test_numbers_that_are_not_finite_are_null() -> None:
    nan, inf = float("nan"), float("inf")
    assert json.loads(strict({"a": [nan, 1.0, {"b": (inf, -inf)}], "c": "NaN"})) == {
        "a": [None, 1.0, {"b": [None, None]}],
        "c": "NaN",
    }


def test_names_that_are_no_text_can_be_written(place: Path) -> None:
    write_text(place / "a.html", "log \udcff")
    assert (place / "a.html").read_bytes() == b"log \\udcff"


def test_what_was_written_before_the_vanishing_of_the_folder_can_be_read(place: Path) -> None:
    (place / "d").mkdir()
    with outputs.guarding("reconstruct"):
        folder = outputs.take_folder(place / "d")
        os.rmdir(folder)
        write_json(folder / "a.json", {"schema": "armloop/model/1"})
    assert json.loads((place / "d" / "a.json").read_text())["written_by"] == "armloop reconstruct"


def test_a_models_file_says_who_wrote_it_and_can_be_read(place: Path) -> None:
    model = load_model(place / "model.json")
    with outputs.guarding("diagnose"):
        model.save(place / "again.json")
    assert json.loads((place / "again.json").read_text())["written_by"] == "armloop diagnose"
    assert load_model(place / "again.json").to_dict() == model.to_dict()


def test_a_drake_program_that_does_not_run_is_not_written(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("armloop.export.drake_bundle._PROGRAM", "raise RuntimeError({step}, {smoothing})")
    before = contents(place)
    assert main(["export", "model.json", "--to", "drake", "--out", "bundle"]) == 2
    assert re.fullmatch(r"armloop: bundle: the program does not run in Drake: .*\n", capsys.readouterr().err)
    left = {path: content for path, content in contents(place).items() if not path.endswith(".armloop")}
    assert left == before
