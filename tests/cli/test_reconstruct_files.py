"""`armloop reconstruct` takes many Parquet files; what is wrong with jobs or scheduler is one line and status 2."""

import json
from pathlib import Path

import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import write_log
from armloop.util import workers


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder, paths = tmp_path_factory.mktemp("logs"), []
    for seed in range(2):
        motion = fourier_motion(8.0, 125.0, seed)
        tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
        paths.append(str(folder / f"run{seed}.parquet"))
        write_log(paths[-1], measured(motion, tau, seed))
    return paths


def reconstruct(files: list[str], out: Path, *more: str) -> int:
    command = ["reconstruct", *files, "--arm", "three_axis", "--out", str(out), "--max-order", "1", "--json"]
    return main([*command, *more])


def test_many_files_make_one_model(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert reconstruct(files, tmp_path / "model.json", "--jobs", "2") == 0
    answer = json.loads(capsys.readouterr().out)
    assert [step["step"] for step in answer["steps"]] == [1, 2, 3]
    model = json.loads((tmp_path / "model.json").read_text())
    assert model["history"]["logs"] == ["run0", "run1"]


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (("--jobs", "0"), "--jobs: '0' is no number of processes; give 1 to 1024"),
        (("--scheduler", "tcp://127.0.0.1:9"), "no Dask scheduler answers there"),
    ],
)
def test_what_cannot_compute_is_said_in_one_line(
    files: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    more: tuple[str, str],
    expected: str,
) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 0.3)
    assert reconstruct(files, tmp_path / "model.json", *more) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert expected in line
    assert not (tmp_path / "model.json").exists()


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (
            ("--library", "rigid-body", "--friction", "coulomb,sticky"),
            "unknown friction law 'sticky'; there are: coulomb,",
        ),
        (("--library", "lagrangian", "--friction", ","), "no friction law is named; there are: coulomb,"),
        (("--friction", "coulomb"), "laws are chosen with --library rigid-body or lagrangian"),
        (
            ("--method", "sindy", "--friction", "coulomb"),
            "laws are chosen with --library rigid-body or lagrangian",
        ),
    ],
)
def test_friction_laws_that_cannot_be_chosen_are_said_in_one_line(
    files: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    more: tuple[str, ...],
    expected: str,
) -> None:
    assert reconstruct(files, tmp_path / "model.json", *more) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert expected in line
    assert not (tmp_path / "model.json").exists()


def test_friction_is_restricted_to_the_laws_named(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = ["--library", "rigid-body", "--friction", "coulomb, viscous", "--jobs", "2"]
    command = ["reconstruct", *files, "--arm", "three_axis", "--out", str(tmp_path / "model.json")]
    assert main([*command, *more]) == 0
    said = capsys.readouterr()
    assert "note: friction: nothing but coulomb, viscous" in said.out
    assert "--jobs is not used: logs of up to 500,000 samples are kept in memory" in said.err
    # one process it is anyway
    assert main([*command, *more[:-1], "1", "--force"]) == 0 and "--jobs" not in capsys.readouterr().err
    terms = json.loads((tmp_path / "model.json").read_text())["friction"]
    assert {term["kind"] for joint in terms for term in joint} <= {"smooth_sign", "viscous"}
