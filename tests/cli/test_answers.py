"""What commands answer with --json, and what they write, is what the published schemas describe."""

import json
import logging
from pathlib import Path
from typing import Any

import pytest

import armloop as al
from armloop.cli import main
from armloop.schemas.checking import checked
from armloop.schemas.published import FILES

SHORT = (
    "plant: three_axis\nreference: {kind: fourier, duration: 5.0}\nscore: [1.0, 5.0]\ncontrollers: [pid]\n"
)
# schema, the command, the file that it writes of the same schema
ANSWERS = {
    "evaluation": ("evaluate model.json good.csv", None),
    "reconstruction": (
        "reconstruct good.csv --arm three_axis --library rigid-body --out OUT/model.json",
        None,
    ),
    "crossvalidation": (
        "crossvalidate good.csv --arm three_axis --library rigid-body --cutoff 8 --block 2 --out OUT",
        "crossvalidation.json",
    ),
    "diagnosis": ("diagnose model.json good.csv --out OUT", "diagnosis.json"),
    "cluster": ("cluster good.csv", None),
    "tracking": ("track short.yaml --out OUT", "tracking.json"),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_is_as_its_schema_says(
    name: str,
    inputs: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    command, written = ANSWERS[name]
    monkeypatch.chdir(inputs)
    words = command.replace("OUT", str(tmp_path / "out")).replace("short.yaml", str(tmp_path / "short.yaml"))
    (tmp_path / "short.yaml").write_text(SHORT)
    assert main([*words.split(), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    checked(answer, FILES[name])
    if written is not None:
        content = json.loads((tmp_path / "out" / written).read_text())
        checked(content, FILES[name])
        assert content.keys() - answer.keys() <= {"schema", "written_by"}
    if name in ("reconstruction", "diagnosis"):
        checked(json.loads((tmp_path / "out" / "model.json").read_text()), FILES["model"])


def test_an_answer_that_is_not_is_noticed() -> None:
    errors = {"rmse": [0.1], "nrmse": [0.2]}
    answer = {**errors, "moving": errors, "standstill": {"rmse": [None], "nrmse": [None]}, "samples": 10}
    checked(answer, FILES["evaluation"])
    for wrong in ({"samples": -1}, {"rmse": [-0.1]}, {"moving": {"rmse": [0.1]}}, {"nrmse": "small"}):
        with pytest.raises(ValueError):
            checked({**answer, **wrong}, FILES["evaluation"])


def test_a_home_that_cannot_be_written_to_is_nobodys_trouble(
    inputs: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """As in a container: where no cache of fonts can be kept, matplotlib makes one anew, and would say so at length."""
    monkeypatch.chdir(inputs)

    def complaining(options: Any) -> list[str]:
        logging.getLogger("matplotlib").warning("no place")
        return []

    monkeypatch.setattr("armloop.cli._named_files", complaining)
    assert main(["cluster", "good.csv", "--json"]) == 0
    assert not caplog.records
    assert logging.getLogger("matplotlib").isEnabledFor(logging.WARNING)


def test_evaluate_and_its_page_say_why_a_diagnosis_states_other_errors(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(inputs)
    said = "A diagnosis, which leaves out the ends of a run, events"
    assert main(["evaluate", "model.json", "good.csv"]) == 0
    assert said in " ".join(capsys.readouterr().out.split())
    page = al.load_model("model.json").score(al.read_log("good.csv")).report(tmp_path / "score.html")
    assert said in page.read_text(encoding="utf-8")
