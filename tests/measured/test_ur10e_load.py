"""The load is learnt from one half of its run and judged on the other, at other rates too, by models of fewer logs.

What came out: 2.784 ± 0.012 kg from the first half, 2.800 ± 0.019 kg from the second (2.805 kg were bolted on); mean
nRMSE of the moving joints on the half that was not seen 0.36 before, 0.038 and 0.037 after.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from armloop.cli import main

pytestmark = pytest.mark.measured

GAINS = "11.75,11.98,9.83,10.75,10.55,10.9"
LOADED = "load_20_01_31-load.csv"
MASS = 2.805


def answer(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> dict:
    """What a command prints with --json; nothing else may stand on standard output."""
    capsys.readouterr()
    assert main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def check_payload(found: dict) -> None:
    """A payload alone, of the right mass, that leaves no more than a run without it."""
    assert [effect["effect"] for effect in found["effects"]] == ["payload"]
    assert found["effects"][0]["parameters"]["mass"]["value"] == pytest.approx(MASS, rel=0.07)
    assert np.mean(found["error"]["nrmse"]["after"]) <= 0.055


def resampled(log: Path, rate: float, path: Path) -> Path:
    """The log on a grid of another rate, Hz, by linear interpolation."""
    data = np.genfromtxt(log, delimiter=",", names=True)
    time = np.arange(data["time"][0], data["time"][-1], 1 / rate)
    columns = [time, *(np.interp(time, data["time"], data[name]) for name in data.dtype.names[1:])]
    np.savetxt(path, np.column_stack(columns), "%.8f", ",", header=",".join(data.dtype.names), comments="")
    return path


@pytest.mark.long
@pytest.mark.parametrize(("half", "rate"), [(0, 50.0), (0, 100.0), (1, 100.0)])
def test_a_half_of_the_run_tells_the_load_and_the_other_half_confirms_it(
    model: Path, ur10e: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], half: int, rate: float
) -> None:
    """At another rate than the model's logs, too, which have 100 Hz."""
    header, *rows = (ur10e / LOADED).read_text().splitlines(keepends=True)
    middle = len(rows) // 2
    halves = [tmp_path / "first.csv", tmp_path / "second.csv"]
    for path, part in zip(halves, (rows[:middle], rows[middle:]), strict=True):
        path.write_text(header + "".join(part))
    seen, unseen = halves[half], halves[1 - half]
    if rate != 100.0:
        seen = resampled(seen, rate, tmp_path / "resampled.csv")
    check_payload(answer(capsys, ["diagnose", str(model), str(seen), "--out", str(tmp_path / "out")]))
    before, after = (
        np.mean(answer(capsys, ["evaluate", str(path), str(unseen)])["moving"]["nrmse"])
        for path in (model, tmp_path / "out" / "model.json")
    )
    assert after <= 0.055 < 0.3 <= before


@pytest.mark.long
@pytest.mark.parametrize("rate", [50.0, 250.0])
def test_the_load_is_found_at_another_rate(
    model: Path, ur10e: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], rate: float
) -> None:
    path = resampled(ur10e / LOADED, rate, tmp_path / "resampled.csv")
    found = answer(capsys, ["diagnose", str(model), str(path), "--out", str(tmp_path / "out")])
    check_payload(found)


@pytest.mark.long
def test_a_model_of_a_few_logs_finds_the_load(
    ur10e: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = [str(ur10e / f"noload_20_02_{name}.csv") for name in ("12-40sec_12harm", "12-50sec_12harm")]
    few = str(tmp_path / "few.json")
    arm = ["--arm", str(ur10e / "ur10e.urdf"), "--library", "rigid-body", "--drive-gains", GAINS]
    answer(capsys, ["reconstruct", *logs, *arm, "--out", few])
    found = answer(capsys, ["diagnose", few, str(ur10e / LOADED), "--out", str(tmp_path / "out")])
    check_payload(found)
