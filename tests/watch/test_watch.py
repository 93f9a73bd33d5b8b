"""A fleet is watched: what changed is found and named, what did not is left alone, what is broken is set aside."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from answers import answered
from operation import contents

from armloop.cli import main
from armloop.commands import watch as watch_command
from armloop.data.tables import write_columns
from armloop.watch import Options, watch
from armloop.watch.fleet import model_and_digest
from armloop.watch.sources import find_logs
from armloop.watch.store import Store

pytestmark = pytest.mark.slow

CHANGED = 26


@pytest.fixture(scope="module")
def watched(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store after one call."""
    store = tmp_path_factory.mktemp("watched") / "store"
    arguments = ["--models", str(fleet / "models"), "--logs", str(fleet / "logs"), "--store", str(store)]
    assert main(["watch", *arguments, "--sums-only"]) == 3
    return store


def test_what_changed_is_found_named_and_dated(watched: Path) -> None:
    alarms = {alarm["arm"]: alarm for alarm in Store(watched).alarms()}
    assert set(alarms) == {"loaded", "rubbing"}
    load, friction = alarms["loaded"], alarms["rubbing"]
    (effect, *_) = load["effects"]
    assert effect["effect"] == "payload"
    assert effect["parameters"]["mass"]["value"] == pytest.approx(0.3, rel=0.05)
    assert friction["effects"][0]["joint"] == 2
    assert "friction" in friction["effects"][0]["effect"] or "drag" in friction["effects"][0]["effect"]
    # nothing tells how warm joint 2 was
    assert [item["effect"] for item in friction["alternatives"]] == ["warm_up"]
    for alarm in alarms.values():
        assert alarm["delay"]["units"] <= 14
        assert alarm["since_log"] >= f"2026-01-{1 + (CHANGED - 2) // 10:02d}"
        assert alarm["course"]["form"] in ("step", "cannot_tell")


def test_a_second_call_finds_nothing_new_and_changes_no_byte(
    fleet: Path, watched: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(watched)
    arguments = ["--models", str(fleet / "models"), "--logs", str(fleet / "logs"), "--store", str(watched)]
    assert main(["watch", *arguments, "--sums-only", "--json"]) == 0
    answer = answered(capsys.readouterr().out, "watch")
    assert answer["logs"] == {"read": 0, "known": 120, "set_aside": 0}
    assert (answer["new"], len(answer["alarms"])) == ([], 2)
    assert contents(watched) == before
    # the same answer with the alarms told for the first time
    told = json.dumps({**answer, "new": Store(watched).alarms(), "set_aside": []})
    assert len(answered(told, "watch")["new"]) == 2


def test_the_page_stands_by_itself(fleet: Path, watched: Path, tmp_path: Path) -> None:
    page = tmp_path / "watch.html"
    arguments = ["--models", str(fleet / "models"), "--logs", str(fleet / "logs"), "--store", str(watched)]
    assert main(["watch", *arguments, "--sums-only", "--report", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "http://" not in text.replace("http://www.w3.org", "") and "https://" not in text
    for words in ("Trends of", "payload", "loaded", "rubbing", "healthy", "warm up"):
        assert words in text


def test_so_few_logs_that_no_alarm_is_possible_are_not_called_unchanged(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor is an arm that the store does not know shown; what comes in batches is counted together."""
    logs = sorted((fleet / "logs" / "healthy").iterdir())[:5]
    monkeypatch.setattr(watch_command, "_batches", lambda stream: iter([[str(log)] for log in logs[:3]]))
    page, store = tmp_path / "watch.html", str(tmp_path / "store")
    arguments = [
        "watch",
        "--models",
        str(fleet / "models"),
        "--store",
        store,
        "--sums-only",
        "--report",
        str(page),
    ]
    assert main([*arguments, "--logs", "-", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["logs"]["read"] == 3
    (arm,) = answer["arms"]
    (note,) = arm["notes"]
    assert re.fullmatch(r"an alarm takes \d\d units of operation, there are 3", note)
    assert note.split()[3] == str(arm["units_for_alarm"]) and arm["units_since_alarm"] == 3
    text = page.read_text(encoding="utf-8")
    assert "Of no arm there is enough operation yet" in text and "has changed" not in text
    assert main([*arguments, "--logs", *map(str, logs), "--arm", "elbow"]) == 2
    assert (
        "--arm elbow: there is no such arm among the logs or in the store; there are healthy"
        in capsys.readouterr().err
    )


def test_how_many_units_an_alarm_takes_heeds_programmes_and_alarms(
    fleet: Path, watched: Path, tmp_path: Path
) -> None:
    """A folder for each session is a programme for each, and nothing is ever compared."""
    for k, log in enumerate(sorted((fleet / "logs" / "healthy").iterdir())):
        folder = tmp_path / "logs" / "healthy" / f"session{k}"
        folder.mkdir(parents=True)
        (folder / log.name).symlink_to(log)
    logs = find_logs([tmp_path / "logs"])
    (arm,) = watch(fleet / "models", logs, tmp_path / "store", Options(full=False)).arms
    assert arm["units_since_alarm"] == 40 < arm["units_for_alarm"]
    (note,) = arm["notes"]
    assert (
        f"an alarm takes {arm['units_for_alarm']} units of operation, there are 40, in 40 programmes, at most 1"
        in note
    )
    by_name = {arm["arm"]: arm for arm in watch(fleet / "models", [], watched, Options(full=False)).arms}
    assert by_name["healthy"]["units_for_alarm"] <= by_name["healthy"]["units_since_alarm"] == 40
    assert by_name["healthy"]["notes"] == []
    (note,) = by_name["loaded"]["notes"]
    since = by_name["loaded"]["units_since_alarm"]
    assert since < 14 and f"another alarm takes {by_name['loaded']['units_for_alarm']} units" in note
    assert note.endswith(f"there are {since} since the last one")


def test_a_model_that_is_replaced_is_read_anew(fleet: Path, tmp_path: Path) -> None:
    path, other = tmp_path / "model.json", fleet / "models" / "healthy.json"
    path.write_bytes(other.read_bytes())
    first = model_and_digest(path)
    assert model_and_digest(path)[0] is first[0]
    path.write_text(json.dumps({**json.loads(other.read_text()), "notes": ["another"]}))
    again = model_and_digest(path)
    assert again[1] != first[1] and again[0] is not first[0]


@pytest.mark.parametrize(
    ("arm", "portions"),
    [
        ("loaded", ((0, 7), (0, 31), (31, 32), (32, 33), (33, 40))),
        # late logs upset the order of what was tested
        ("healthy", ((20, 40), (0, 25))),
    ],
)
def test_the_same_logs_in_portions_give_the_same_bytes(
    fleet: Path, watched: Path, tmp_path: Path, arm: str, portions: tuple[tuple[int, int], ...]
) -> None:
    files = [file for file in find_logs([fleet / "logs"]) if file.arm == arm]
    for first, last in portions:
        watch(fleet / "models", files[first:last], tmp_path / "store", Options(full=False))
    whole = {k: v for k, v in contents(watched).items() if f"arm={arm}" in k}
    mine = {k: v for k, v in contents(tmp_path / "store").items() if f"arm={arm}" in k}
    assert mine.keys() == whole.keys() and f"running/arm={arm}.parquet" in mine
    assert [k for k in whole if mine[k] != whole[k]] == []


def test_a_running_state_that_is_broken_or_of_another_version_is_made_anew(
    watched: Path, fleet: Path
) -> None:
    import pyarrow.parquet

    before = contents(watched)
    (watched / "running" / "arm=loaded.parquet").write_bytes(b"cut off")
    older = watched / "running" / "arm=rubbing.parquet"
    table = pyarrow.parquet.read_table(older, partitioning=None)
    pyarrow.parquet.write_table(
        table.replace_schema_metadata({"armloop": '{"asked": "an older version"}'}), older
    )
    for arm in ("loaded", "rubbing"):
        (watched / "tested" / f"arm={arm}.json").unlink()
    watch(fleet / "models", [], watched, Options(full=False))
    assert contents(watched) == before


def test_broken_and_foreign_logs_are_set_aside_with_their_reason(fleet: Path, tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    (logs / "healthy").mkdir(parents=True)
    (logs / "stranger").mkdir()
    good = sorted((fleet / "logs" / "healthy").iterdir())[0]
    shutil.copy(good, logs / "healthy")
    (logs / "healthy" / "broken.csv").write_text("time,q1,v1,tau1\n0,1,2\n", encoding="utf-8")
    (logs / "healthy" / "cut.parquet").write_bytes(good.read_bytes()[:900])
    shutil.copy(sorted((fleet / "logs" / "loaded").iterdir())[0], logs / "stranger")
    outcome = watch(fleet / "models", find_logs([logs]), tmp_path / "store")
    assert (outcome.counts.read, outcome.counts.aside) == (1, 3)
    reasons = {Path(item["log"]).name: item["reason"] for item in outcome.aside}
    assert "joints" in reasons["broken.csv"] or "row 1" in reasons["broken.csv"]
    assert "Parquet" in reasons["cut.parquet"]
    assert any("no model of arm 'stranger'" in reason for reason in reasons.values())
    # a model comes: the log is used, and is aside no more
    models = tmp_path / "models"
    shutil.copytree(fleet / "models", models)
    shutil.copy(models / "healthy.json", models / "stranger.json")
    again = watch(models, find_logs([logs]), tmp_path / "store")
    assert (again.counts.read, len(again.aside)) == (1, 2)


def test_a_log_is_aside_for_what_the_last_call_says_of_it(fleet: Path, tmp_path: Path) -> None:
    logs, models = tmp_path / "logs", tmp_path / "models"
    (logs / "stranger").mkdir(parents=True)
    (logs / "stranger" / "broken.csv").write_text("time,q1,v1,tau1\n0,1,2\n", encoding="utf-8")
    watch(fleet / "models", find_logs([logs]), tmp_path / "store")
    models.mkdir()
    shutil.copy(fleet / "models" / "healthy.json", models / "stranger.json")
    (aside,) = watch(models, find_logs([logs]), tmp_path / "store").aside
    assert "no model" not in aside["reason"]


def test_a_log_that_was_broken_is_no_longer_aside_once_it_is_whole_or_gone(
    fleet: Path, tmp_path: Path
) -> None:
    """A log that is still being written is broken; of one whose folder is not mounted nothing is known."""
    logs, good = tmp_path / "logs" / "healthy", sorted((fleet / "logs" / "healthy").iterdir())[0]
    logs.mkdir(parents=True)
    for k, name in enumerate(("writing", "deleted", "stays")):
        (logs / f"{name}.parquet").write_bytes(good.read_bytes()[: 900 + k])

    def aside() -> set[str]:
        found = watch(
            fleet / "models", find_logs([logs.parent]), tmp_path / "store", Options(full=False)
        ).aside
        assert {item["arm"] for item in found} == {"healthy"}  # though nothing can be read of it
        return {Path(item["log"]).stem for item in found}

    assert aside() == {"writing", "deleted", "stays"}
    shutil.copy(good, logs / "writing.parquet")
    (logs / "deleted.parquet").unlink()
    assert aside() == {"stays"}
    logs.rename(tmp_path / "unmounted")
    assert aside() == {"stays"}


def test_that_there_is_no_log_is_said(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], watched: Path
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    call = ["watch", "--models", str(fleet / "models"), "--logs", str(empty), "--sums-only", "--store"]
    assert main([*call, str(tmp_path / "store")]) == 2
    said = capsys.readouterr().err
    assert f"{empty}: holds no log" in said and said.count("\n") == 1
    assert not (tmp_path / "store").exists()
    assert main([*call, str(watched)]) == 0  # what was read may have been put away
    assert f"warning: {empty}: holds no log" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--models", "nowhere", "--logs", "."], "holds no model"),
        (["--models", "MODELS", "--logs", "nowhere"], "no such file or folder"),
        (["--models", "MODELS", "--logs", ".", "--false-alarm-hours", "-3"], "positive number of hours"),
    ],
)
def test_what_is_wrong_is_one_line(
    fleet: Path, tmp_path: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(fleet / "models") if word == "MODELS" else word for word in arguments]
    assert main(["watch", *given, "--store", str(tmp_path / "store")]) == 2
    said = capsys.readouterr().err
    assert words in said and len(said.splitlines()) == 1


def test_a_call_that_sets_every_log_aside_says_so(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whoever looks at the status alone (cron) must not take it for an arm that is well."""
    logs = tmp_path / "logs" / "stranger"
    logs.mkdir(parents=True)
    (logs / "broken.csv").write_text("time,q1,v1,tau1\n0,1,2\n", encoding="utf-8")
    call = [
        "watch",
        "--models",
        str(fleet / "models"),
        "--logs",
        str(tmp_path / "logs"),
        "--store",
        str(tmp_path / "s"),
    ]
    for more in ([], ["--json"], []):  # that they are known to be broken makes nothing better
        assert main([*call, *more]) == 2
        answer = capsys.readouterr()
        assert "every log of this call was set aside, none is watched (1)" in answer.err
        assert answer.err.count("\n") == 1 and "stranger" in answer.out
    (tmp_path / "logs" / "healthy").mkdir()
    shutil.copy(sorted((fleet / "logs" / "healthy").iterdir())[0], tmp_path / "logs" / "healthy")
    assert main(call) == 0


def test_a_folder_of_something_else_is_no_store(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_columns(tmp_path / "mine.csv", {"time": np.arange(3.0)})
    assert (
        main(["watch", "--models", str(fleet / "models"), "--logs", str(tmp_path), "--store", str(tmp_path)])
        == 2
    )
    assert "neither empty nor a store" in capsys.readouterr().err
