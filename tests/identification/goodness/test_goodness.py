"""A reconstruction says how good it is, and a model that lacks a law says that first."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, write_log
from armloop.data.pieces import log_sources
from armloop.identification.goodness import Parts, unjudged
from armloop.identification.reconstruction import Options, reconstruct
from armloop.model import load_model
from armloop.regression.sparse import Sparse
from armloop.reports.reconstruction_report import reconstruction_sections

PLAIN = Options(standard_errors=False)


def log(seed: int, missing: bool = False) -> MotionLog:
    """A run; ``missing``: with a law on joint 2 that no catalogue and no library of base parameters has."""
    motion = fourier_motion(40, 100, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    if missing:
        tau[:, 1] += 4.0 * np.cos(2 * motion.q[:, 0]) * motion.v[:, 2]
    return measured(motion, tau, seed, name=f"run_{seed}")


def test_a_good_model_leaves_noise() -> None:
    made = reconstruct([log(1), log(2)], three_axis(), library="rigid-body", options=PLAIN)
    assert made.warnings == []
    for part in made.parts:
        assert part.explained is not None and part.predictable_left is not None and part.noise is not None
        assert part.explained > 0.99 and part.predictable_left < 0.002
        assert part.explained + part.predictable_left + part.noise == pytest.approx(1.0)
    answer = made.to_dict()["joints"]
    assert [entry["joint"] for entry in answer] == [1, 2, 3]
    assert made.model.baseline["joints"] == answer


def test_joints_that_are_not_judged_are_said_to_be_with_the_reason() -> None:
    assert unjudged([Parts(1, 0.9, 0.0, 0.1)]) == []
    (note,) = unjudged([Parts(1), Parts(2, 0.9, 0.0, 0.1), Parts(3)])
    assert note.startswith("joints 1, 3: ") and "fewer than 200 samples" in note
    made = reconstruct([log(1)], three_axis(), library="rigid-body", options=PLAIN)
    (section,) = reconstruction_sections(replace(made, parts=[Parts(1), *made.parts[1:]]))
    assert section.notes[0].startswith("joint 1: the torque's energy is not parted")


def test_a_model_that_lacks_a_law_says_so_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [str(tmp_path / f"{seed}.csv") for seed in (1, 2)]
    for seed, path in zip((1, 2), paths, strict=True):
        write_log(path, log(seed, missing=True))
    out, report = tmp_path / "model.json", tmp_path / "report.html"
    command = ["reconstruct", *paths, "--arm", "three_axis", "--library", "rigid-body", "--out", str(out)]
    assert main([*command, "--report", str(report)]) == 0
    text = capsys.readouterr().out
    first = next(line for line in text.splitlines() if not line.startswith("  … "))
    assert first.startswith("WARNING: joint 2: the model leaves") and "predictable" in first
    assert "Parts of the torque's energy" in text
    page = report.read_text()
    assert page.index("joint\u00a02: the model leaves") < page.index("<section")
    joints = load_model(out).baseline["joints"]
    assert joints[1]["predictable_left"] > 10 * joints[1]["noise"]
    assert json.loads(out.read_text())["baseline"]["joints"] == joints


def test_logs_that_are_streamed_are_judged_alike(tmp_path: Path) -> None:
    """Streamed chunk by chunk or kept in memory: about the same parts."""
    path = tmp_path / "run.csv"
    write_log(path, log(1, missing=True))
    found = []
    for in_memory in (10**6, 0):
        logs = log_sources([str(path)], 3, {"unit": "N*m", "drive_gains": None}, in_memory)
        made = reconstruct(
            logs,
            three_axis(),
            library="double-feature-set",
            options=Options(max_order=1, standard_errors=False, sparse=Sparse("thresholded")),
            in_memory=in_memory,
        )
        found.append([part.predictable_left for part in made.parts])
    np.testing.assert_allclose(found[0], found[1], rtol=0.3, atol=1e-3)
