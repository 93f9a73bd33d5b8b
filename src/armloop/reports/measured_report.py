"""Results on the measured arm, for a terminal and the report: a model of free motion, and contacts with a person."""

from __future__ import annotations

import numpy as np

from armloop.laws.effects.events import ends
from armloop.reports.diagnosis_tables import diagnosis_table, events_table
from armloop.reports.findings import findings, reasons
from armloop.reports.html import Picture, Section
from armloop.reports.loop_result import MeasuredResult
from armloop.reports.plots import residual_time_figure
from armloop.reports.prose import Prose
from armloop.reports.tables import Table, make_table, score_table
from armloop.reports.words import counted, number

_TITLE = "The same on measured data"


def measured_words(result: MeasuredResult) -> str:
    """All of it for a terminal."""
    parts = [_free_table(result), diagnosis_table(result.diagnosis), *_push_tables(result)]
    return "\n\n".join(map(str, parts))


def measured_section(result: MeasuredResult) -> Section:
    """The part of the loop's report that is measured, not simulated."""
    say = Prose("measured", moving=float(np.nanmean(result.free.moving["nrmse"])))
    events = [events_table(result.diagnosis)] if result.diagnosis.contacts else []
    return Section(
        _TITLE,
        [*say.paragraphs("text"), *findings(result.diagnosis)],
        [Picture(residual_time_figure(result.diagnosis), say["residual"])],
        [_free_table(result), *events, *_push_tables(result)],
        notes=reasons(result.diagnosis),
    )


def _push_tables(result: MeasuredResult) -> list[Table]:
    """What was found of the pushes, if any were."""
    return [_pushes_table(result), _during_table(result)] if result.diagnosis.contacts else []


def _free_table(result: MeasuredResult) -> Table:
    return score_table(result.free, result.model.arm, "The model on a free run that it was not made of")


def _pushes_table(result: MeasuredResult) -> Table:
    """Length and mean force of each push found, and the sensor's range in another run of the motion."""
    rows: list[list[object]] = []
    for k, contact in enumerate(result.diagnosis.contacts):
        p = contact.added.parameters
        start, end = ends(p)
        if contact.added.effect.joint is None:
            force = number(float(np.linalg.norm(np.asarray(p["force"].value))), 2)
            rows.append([f"push {k + 1}", f"{end - start:.2f}", force])
    seconds, forces = result.record["seconds"], result.record["force"]
    rows.append(
        [
            "force sensor, another run of this motion",
            f"{seconds[0]:g} to {seconds[1]:g}",
            f"{forces[0]:g} to {forces[1]:g}",
        ]
    )
    title = f"{counted(len(rows) - 1, 'push', 'pushes')} beside what a force sensor showed"
    return make_table(["", "length [s]", "force [N]"], rows, title)


def _during_table(result: MeasuredResult) -> Table:
    rows = [
        [f"{j + 1}  {joint.name}", before, after]
        for j, (joint, before, after) in enumerate(
            zip(result.model.arm.joints, result.during["before"], result.during["after"], strict=True)
        )
    ]
    return make_table(["joint", "before", "after"], rows, "RMSE while it was pushed, N·m")
