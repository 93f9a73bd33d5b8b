"""An alarm is known by what it was found with, and its logs are diagnosed by the first call that asks and has them."""

import json
import shutil
from functools import partial
from pathlib import Path

import pytest
from answers import answered
from operation import contents, operate

from armloop.cli import main
from armloop.data import pieces
from armloop.data.log import MotionLog, write_log
from armloop.model import ReconstructedModel, load_model
from armloop.watch import Options, Outcome, sources, watch
from armloop.watch.diagnosed import diagnose_alarms
from armloop.watch.sources import LogFile, find_logs
from armloop.watch.store import Store

pytestmark = pytest.mark.slow


@pytest.fixture
def models(fleet: Path, tmp_path: Path) -> Path:
    (tmp_path / "models").mkdir()
    return Path(shutil.copy(fleet / "models" / "loaded.json", tmp_path / "models")).parent


@pytest.fixture
def logs(fleet: Path) -> list[LogFile]:
    return find_logs([fleet / "logs" / "loaded"])


def test_an_alarm_is_known_by_its_model_and_options(
    models: Path, logs: list[LogFile], tmp_path: Path
) -> None:
    store = tmp_path / "store"

    def told(hours: float = 1000.0, healthy: int = 20) -> Outcome:
        outcome = watch(models, logs, store, Options(hours, healthy, full=False))
        assert len(outcome.alarms) == 1  # those of other models and options are not told beside it
        Store(store).announce(outcome.new)
        return outcome

    first = told()
    assert first.new == [first.alarms[0]["id"]]
    assert told(1000).alarms == first.alarms and told().new == []
    other = told(healthy=15)
    assert other.new == [other.alarms[0]["id"]] != first.new
    path = models / "loaded.json"
    was = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**was, "notes": ["another"]}), encoding="utf-8")
    replaced = told()
    assert replaced.counts.read == len(logs)
    assert replaced.new == [replaced.alarms[0]["id"]] and replaced.new[0] not in first.new + other.new
    assert len(Store(store).alarms()) == 3
    assert replaced.alarms[0]["model"] != first.alarms[0]["model"]
    # an arm that is tested no more keeps its alarms
    path.rename(models / "elbow.json")
    assert len(watch(models, [], store, Options(full=False)).alarms) == 3


def test_a_late_log_that_changes_what_an_alarm_says_is_heeded(
    models: Path, logs: list[LogFile], tmp_path: Path
) -> None:
    """Its name may stay, for it came with the same log; the window is another one, and so is the diagnosis."""
    store = tmp_path / "store"
    (alarm,) = watch(models, logs[:28] + logs[29:], store, Options(full=False)).alarms
    Store(store).add_alarm("loaded", alarm["id"], {**alarm, "diagnosis": {"logs": ["stale"]}})
    (again,) = watch(models, logs, store, Options(full=False)).alarms
    assert again["window"] != alarm["window"] and "diagnosis" not in again
    assert watch(models, logs, tmp_path / "fresh", Options(full=False)).alarms == [again]


def test_an_alarm_of_sums_alone_is_diagnosed_when_it_is_asked_for(
    models: Path,
    fleet: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("armloop.watch.diagnosed._DIAGNOSED", 50.0)  # two logs tell as well as seven
    store = tmp_path / "store"
    call = ["watch", "--models", str(models), "--logs", str(fleet / "logs" / "loaded"), "--store", str(store)]
    assert main([*call, "--sums-only"]) == 3
    assert "diagnosis" not in capsys.readouterr().out
    assert main(call) == 0
    said = capsys.readouterr().out
    assert "told before (1): loaded: payload since 2026-01-03" in said
    assert "diagnosed now:" in said and "effects found" in said
    (alarm,) = Store(store).alarms()
    assert alarm["diagnosis"]["effects"][0]["effect"] == "payload" and len(alarm["diagnosis"]["logs"]) == 2
    before = contents(store)
    for more in ([], ["--sums-only"]):  # it is made once, and kept
        assert main([*call, "--json", *more]) == 0
        assert answered(capsys.readouterr().out, "watch")["diagnosed"] == []
    assert contents(store) == before


@pytest.mark.parametrize("piece", [1 << 30, 7200])
def test_of_a_long_log_what_comes_before_the_alarm_is_diagnosed(
    models: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece: int
) -> None:
    """The last 150 s, also where the log is read in pieces (of 120 s, here)."""
    monkeypatch.setattr(pieces, "PIECE", piece)
    monkeypatch.setattr(sources, "log_sources", partial(pieces.log_sources, in_memory=piece))
    taken: list[tuple[float, float]] = []

    class Answer:
        def to_dict(self) -> dict[str, str]:
            return {"verdict": "stands for one"}

    def spied(model: ReconstructedModel, logs: list[MotionLog], jobs: int) -> Answer:
        taken.append((float(logs[0].time[0]), float(logs[0].time[-1])))
        return Answer()

    monkeypatch.setattr("armloop.watch.diagnosed.diagnose", spied)
    write_log(tmp_path / "long.parquet", operate(5, 0, None, 600.0))
    store = Store(tmp_path / "store")
    for name, into in (("a", 420.0), ("b", 599.0)):
        store.add_alarm("loaded", name, {"window": ["log"], "into_log": into})
    diagnose_alarms(
        store,
        "loaded",
        load_model(models / "loaded.json"),
        ["a", "b"],
        {"log": tmp_path / "long.parquet"},
    )
    for (first, last), into in zip(taken, (420.0, 599.0), strict=True):
        assert into - 150.1 <= first and last <= into + 1.1 and last - first > 60.0
        assert last > into - 65.0  # whatever piece it is of, it is near


def test_a_diagnosis_waits_for_logs(
    models: Path, logs: list[LogFile], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Answer:
        def to_dict(self) -> dict[str, str]:
            return {"verdict": "stands for one"}

    monkeypatch.setattr("armloop.watch.diagnosed.diagnose", lambda model, logs, jobs: Answer())
    store = tmp_path / "store"
    watch(models, logs, store, Options(full=False))
    (alarm,) = watch(models, [], store).alarms
    assert "no log of the window is among those of this call" in alarm["diagnosis"]["reason"]
    Store(store).announce([alarm["id"]])
    later = watch(models, logs, store)
    assert later.diagnosed == [alarm["id"]]
    assert later.alarms[0]["diagnosis"]["verdict"] == "stands for one"
