"""Gains under which the arm rings up: nothing is said of margins, and the reader is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from answers import answered

from armloop.drake.control.pid import PidGains
from armloop.drake.experiments.scenarios import TrackingScenario, load_tracking
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.tuning.tuned_loop import along_reference
from armloop.reports.tuning_tables import verified_table
from armloop.util.errors import InputWarning
from armloop.util.progress import silent
from armloop.workflows import tune_scenario
from armloop.workflows.tracking import run_scenario


def wild() -> TrackingScenario:
    """Joint 3 with a derivative gain that rings up, on a short reference."""
    usual = load_tracking("three_axis_tracking")
    gains = PidGains([80.0] * 3, [8.0] * 3, [5.0, 5.0, 60.0])
    short = replace(usual.reference, duration=1.0)
    return replace(usual, gains=gains, controllers=("pid",), reference=short, score=(0.1, 1.0))


def test_a_comparison_says_that_its_loop_is_not_stable(tmp_path: Path) -> None:
    says = "not stable with the scenario's gains; armloop tune proposes others"
    with pytest.warns(InputWarning, match=says):
        run_scenario(wild(), {}, tmp_path, silent)
    answer = answered((tmp_path / "tracking.json").read_text(), "tracking")
    assert answer["stable"] is False and answer["unstable_at_s"][0] == 0.0
    assert all(
        loop["phase_margin_deg"] is None and loop["sensitivity_peak"] is None for loop in answer["loop"]
    )


def test_a_loop_that_is_not_stable_where_its_reference_leads_is_told_of(tmp_path: Path) -> None:
    """Stretched out the arm is heavier about its second joint than folded; gains that fit the former ring up the latter."""
    usual = wild()
    tame = replace(usual, gains=PidGains([80.0] * 3, [8.0] * 3, [5.0, 5.0, 2.0]))
    answer, _ = run_scenario(tame, {}, None, silent)
    assert answer["stable"] is True and answer["unstable_at_s"] == []

    def unstable(gains: PidGains) -> list[float]:
        along = along_reference(usual, usual.effects)
        return [t for t, one in along.items() if not one.is_stable(gains)]

    for kd in np.geomspace(
        2.0, 60.0, 200
    ):  # the postures of a second differ little: the first gain at which one rings up
        gains = PidGains([80.0] * 3, [8.0] * 3, [5.0, 5.0, float(kd)])
        times = unstable(gains)
        if times:
            break
    assert 0.0 not in times
    words = f"where the reference is after {', '.join(f'{t:.3g}' for t in times)} s the loop is not stable"
    with pytest.warns(InputWarning, match=words):
        answer, _ = run_scenario(replace(usual, gains=gains), {}, None, silent)
    assert answer["stable"] is True and answer["unstable_at_s"] == times


def test_a_tuning_states_no_margin_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armloop.workflows.tuning.propose_gains", lambda *_: PidGains.paper(3))
    _, tuning = tune_scenario(wild(), 2 * np.pi * 5, 60.0, None, tmp_path, silent)
    present = answered((tmp_path / "tune.json").read_text(), "tune")["present"]
    assert present["stable"] is False and present["step_deviation"] == [None] * 3
    assert present["along_reference"] == {"phase_margin": [None] * 3, "sensitivity_peak": [None] * 3}
    assert max(map(len, str(verified_table(tuning)).splitlines())) < 100
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    # one card states margins, that of the proposed gains
    assert page.count("least phase margin along the reference") == 1


def test_margins_are_those_of_the_arm_that_is_simulated() -> None:
    """With a load that halves the bandwidth of the joints that carry it."""
    usual = load_tracking("three_axis_tracking")
    short = replace(usual.reference, duration=1.0)
    bare = replace(usual, controllers=("pid",), reference=short, score=(0.1, 1.0))
    load = UndeclaredEffect("payload", None, {"mass": 8.0, "com": [0.05, 0.0, 0.0]})
    answers = [run_scenario(each, {}, None, silent)[0] for each in (bare, replace(bare, effects=(load,)))]
    without, carrying = ([loop["bandwidth_rad_s"] for loop in answer["loop"]] for answer in answers)
    assert carrying[1] < 0.5 * without[1] and carrying[2] < 0.5 * without[2]
