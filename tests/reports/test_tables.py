"""Tables show the numbers of the objects they are made from, aligned."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.diagnosis import Diagnosis, close
from armloop.diagnosis.pushes import Contact
from armloop.drake.experiments.metrics import Metrics
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect
from armloop.reports import findings as findings_module
from armloop.reports.diagnosis_tables import diagnosis_table, events_table
from armloop.reports.findings import _together, alternatives, findings, nothing_to_supply
from armloop.reports.tables import (
    eta_table,
    formulas,
    make_table,
    score_table,
    steps_table,
    table,
)
from armloop.reports.tracking_tables import metrics_table


def test_columns_are_aligned() -> None:
    lines = table(["joint", "RMSE"], [["1", 0.5], ["12", None]], "Errors").splitlines()
    assert lines[0] == "Errors"
    assert lines[2:] == ["joint   RMSE", lines[1], "1      0.500", "12         –", lines[1]]


def test_a_row_needs_a_cell_per_header() -> None:
    with pytest.raises(ValueError, match="1 cells, the table 2 columns"):
        make_table(["a", "b"], [[1]])


def test_eta_stands_beside_the_papers(loop: SimpleNamespace) -> None:
    rows = {row[0]: row[1:] for row in eta_table(loop.tracking, paper=True).rows}
    assert rows["PID"][3:] == ("1.10", "1.21", "1.23")
    assert rows["PID + Step III"][3:] == ("0.250", "0.250", "0.270")
    assert float(rows["PID"][0]) == pytest.approx(loop.tracking["pid"].eta[0], rel=5e-3)
    assert len(eta_table(loop.tracking).headers) == 4


@pytest.mark.parametrize(
    ("joint", "more", "tool", "said"),
    [
        (None, {}, 0.0, True),
        (None, {}, 0.1, False),
        (None, {"link": Estimate(2.0, 0.1, "1")}, 0.0, False),
        (None, {"point": Estimate([0.0, 0.0, 0.2], [0.1, 0.1, 0.1], "m")}, 0.0, False),
        (1, {}, 0.0, False),
    ],
)
def test_a_force_on_a_tool_that_the_urdf_lacks_is_said_to_be_at_the_last_joint(
    clean: Diagnosis,
    joint: int | None,
    more: dict[str, Estimate],
    tool: float,
    said: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Four fifths of a force's lever may be missing."""
    name, size = ("external_torque", "torque") if joint else ("external_contact", "force")
    given = {"start": 1.0, "end": 2.0, size: 3.0 if joint else [3.0, 0.0, 0.0]}
    parameters = {key: Estimate(value, value, "") for key, value in given.items()} | more
    X_tool = np.eye(4)
    X_tool[2, 3] = tool
    contact = SimpleNamespace(added=AddedEffect(effect(name, joint), parameters), share=0.76)
    model = replace(clean.model, arm=replace(clean.model.arm, X_tool=X_tool))
    pushed = replace(clean, contacts=[contact], model=model)
    text = " ".join(findings(pushed))
    assert findings_module._events(pushed) == (
        "events" if joint else "pushes on the arm" if more else "pushes at the tool"
    )
    assert ("no link named `tool`" in text) == said
    assert "76 % of the burst" in text
    # three joints cannot tell where it acted
    assert ("it was another, by more than its error says" in text) == said
    monkeypatch.setattr(findings_module, "FEW", 2)
    text = " ".join(findings(replace(clean, contacts=[contact], model=model)))
    assert ("it was another, as its error says" in text) == said


def test_steps_and_scores(loop: SimpleNamespace) -> None:
    steps = steps_table(loop.reconstruction.reports)
    assert [row[0] for row in steps.rows] == ["1", "2", "3"]
    scores = score_table(loop.reconstruction.held_out, loop.arm)
    assert float(scores.rows[1][3]) == pytest.approx(loop.reconstruction.held_out.moving["rmse"][1], rel=5e-3)


def test_a_diagnosis_names_effect_and_errors(loop: SimpleNamespace, clean: object) -> None:
    text = diagnosis_table(loop.diagnosis)
    assert "Verdict: effects found" in text and "joint spring, joint 2" in text and "stiffness" in text
    assert "Verdict: no effect" in diagnosis_table(clean)


def test_an_events_times_and_link_stand_with_their_errors() -> None:
    of = {"start": (1.234, 0.052), "end": (2.5, 0.1), "link": (3.0, 0.64)}
    parameters = {key: Estimate(value, error, "1") for key, (value, error) in of.items()}
    parameters["force"] = Estimate([3.0, 4.0, 0.0], [0.1, 0.1, 0.1], "N")
    added = AddedEffect(effect("external_contact", None), parameters)
    table = str(events_table(SimpleNamespace(contacts=[SimpleNamespace(added=added, share=0.9)])))
    for cell in ("1.23 ± 0.05", "2.50 ± 0.10", "link 3 ± 0.6", "90 %"):
        assert cell in table
    del parameters["link"]
    assert " tool " in str(events_table(SimpleNamespace(contacts=[SimpleNamespace(added=added, share=0.9)])))
    parameters["point"] = Estimate([0.0, 0.0, 0.1], [0.1, 0.1, 0.1], "m")
    table = str(events_table(SimpleNamespace(contacts=[SimpleNamespace(added=added, share=0.9)])))
    assert "beyond the last link" in table


def test_the_largest_residual_is_said_to_be_of_the_joints_that_were_judged(
    monkeypatch: pytest.MonkeyPatch, clean: Diagnosis
) -> None:
    (every,) = findings(clean)
    assert every.startswith("At its largest the residual is")
    n = clean.model.arm.n
    before = [0.5, *[float("nan")] * (n - 2), 1.5]
    monkeypatch.setattr(Diagnosis, "errors", lambda self: {"before": before, "noise_floor": [1.0] * n})
    (some,) = findings(clean)
    assert some.startswith(f"At its largest, of joints 1 and {n}, the residual is 1.5 times the baseline")


@pytest.mark.parametrize(
    ("shares", "together"),
    [((0.1, 0.2), True), ((0.5, 0.4), False), ((0.1,), False)],
)
def test_effects_that_are_alike_are_told_as_parts_of_a_whole(
    shares: tuple[float, ...], together: bool
) -> None:
    outcome = SimpleNamespace(found=[SimpleNamespace(share=share) for share in shares], together=1.0)
    diagnosis: Any = SimpleNamespace(reversals=None, outcome=outcome)
    assert _together(diagnosis) == (1.0 if together else None)
    diagnosis.reversals = "some"
    assert _together(diagnosis) is None


def test_why_a_controller_adds_nothing(loop: SimpleNamespace, clean: Diagnosis) -> None:
    model = loop.reconstruction.model
    text = diagnosis_table(clean, close(model, clean.model, clean.samples))
    assert "The controller adds nothing: the model is what it was." in text
    found = [
        AddedEffect(effect(name, joint), {}) for name, joint in (("encoder_offset", 1), ("torque_offset", 2))
    ]
    event = AddedEffect(effect("external_contact", None), {})
    assert nothing_to_supply([*found, event]) == (
        "The controller adds nothing: a sensor's fault is no torque that the arm needs; what pushed the arm, was "
        "carried, or came and went, was an event of this run."
    )


def test_what_cannot_be_told_apart_comes_with_the_motion_that_could(loop: SimpleNamespace) -> None:
    (found,) = loop.diagnosis.outcome.found
    rival = (effect("torque_offset", 2), 0.97)
    outcome = replace(loop.diagnosis.outcome, found=[replace(found, rivals=[rival])])
    text = " ".join(diagnosis_table(replace(loop.diagnosis, outcome=outcome)).split())
    assert (
        "This motion cannot tell joint spring, joint 2 from - torque offset, joint 2 (97 %): over a small"
        in text
    )
    assert "a run over a larger range of the joint would tell them apart" in text


def test_events_with_the_same_alternative_are_told_of_together(loop: SimpleNamespace) -> None:
    """Each with its number in the table of events; another joint's stands apart, and what was found has none."""
    rival, none = effect("external_contact", None), np.zeros(0)

    def event(joint: int, share: float) -> Contact:
        times = {key: Estimate(1.0, 0.1, "s") for key in ("start", "end")}
        added = AddedEffect(effect("external_torque", joint), {**times, "torque": Estimate(2.0, 0.1, "N*m")})
        return Contact(added, none, none, none, 0.9, 0.9, [(rival, share)])

    (found,) = loop.diagnosis.outcome.found
    outcome = replace(
        loop.diagnosis.outcome, found=[replace(found, rivals=[(effect("torque_offset", 2), 0.97)])]
    )
    events = [event(2, 0.61), event(3, 0.7), event(2, 0.92)]
    told = replace(loop.diagnosis, outcome=outcome, contacts=events)
    text = " ".join(diagnosis_table(told).split())
    assert (
        "cannot tell external torque, joint 2 (events 1 and 3) from - external contact (61 % to 92 %): on"
        in text
    )
    assert "cannot tell external torque, joint 3 (event 2) from - external contact (70 %): on" in text
    assert "cannot tell joint spring, joint 2 from" in text
    assert text.count("no further run tells them apart") == 2 == len(alternatives(told)) - 1


def test_long_formulas_say_that_they_are_cut(loop: SimpleNamespace) -> None:
    text = formulas(loop.reconstruction.model, width=80, most_terms=2)
    assert max(map(len, text.splitlines())) <= 80
    assert "more terms" in text and text.startswith("tau1 = ")


def test_printing_a_table_loads_nothing_large() -> None:
    program = "import armloop.reports.tables, sys; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"matplotlib", "jinja2", "sklearn", "pydrake"} & set(answer.stdout.split())


def test_headers_stand_on_several_lines_where_a_terminal_would_break_the_rows() -> None:
    heads = ["joint", "predictable, not explained", "RMS torque [N·m, N]", "a name too long"]
    wide = str(make_table(heads, [["1", "0.1 %", "2.84", "x" * 30]]))
    assert max(map(len, wide.splitlines())) <= 80
    # on one line where there is room, and a unit is never broken
    narrow = str(make_table(heads[:2], [["1", "0.1 %"]]))
    assert narrow.splitlines()[1].split("  ") == heads[:2]
    assert wide.split().count("predictable,") == 1 and "[N·m, N]" in wide
    # what stands in the cells is never broken
    assert "x" * 90 in str(make_table(["a", "b c"], [["x" * 90, "1"]]))


def test_how_the_joints_followed_fits_a_terminal() -> None:
    m = Metrics(*(np.array([value, value]) for value in (2.84, 0.123, 0.012, 2.44, 0.125)))
    result = SimpleNamespace(
        unit=("deg", "mm"), rms=np.array([1.35, 0.000466]), largest=np.array([2.52, 0.000958]), metrics=m
    )
    measured = SimpleNamespace(**{**vars(result), "metrics": None})  # no metrics of a simulation
    text = str(metrics_table({"pid": result, "computed_torque": result, "pid_step3": measured}))
    assert max(map(len, text.splitlines())) <= 80
    assert "joint 2 [mm]" in text and "12.5" in text  # a share in percent, as the header says
    assert "[N·m, N]" in text
    turning = str(metrics_table({"pid": SimpleNamespace(**{**vars(result), "unit": ("deg", "deg")})}))
    assert "[N·m]" in turning and "[N·m, N]" not in turning


def test_of_the_joints_samples_a_step_has_the_least_and_the_most() -> None:
    report = SimpleNamespace(step=1, orders=None, candidates=83, independent=33, terms=[34, 12], trials=())
    text = str(
        steps_table([SimpleNamespace(**vars(report), samples=counts) for counts in ([7, 3, 5], [4, 4])])
    )
    assert "3 to 7" in text and "4 to 4" not in text


def test_what_memory_is_called_in_formulas_is_said_below_them(loop: SimpleNamespace) -> None:
    model = loop.reconstruction.model
    own = replace(model, friction=FrictionLaw(((FrictionTerm("hysteresis", 0.2, 0.01),),) * model.arm.n))
    assert any(line.startswith("stop(q,w) is") for line in own.legend())
    assert "stop(" in formulas(own) and max(map(len, formulas(own).splitlines())) <= 80
    assert not any("stop" in line for line in model.legend())
