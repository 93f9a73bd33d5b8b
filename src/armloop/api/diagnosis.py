"""Diagnosis as an object: what a model lacks on a run."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armloop.api.model import Model
from armloop.api.reading import as_logs, require_some
from armloop.api.score import logs_for
from armloop.api.shown import displayed, page
from armloop.commands.arguments import MOST_PROCESSES
from armloop.commands.diagnose import Diagnose as Command
from armloop.data.log import MotionLog
from armloop.data.repeats import require_not_fitted
from armloop.diagnosis import Diagnosis as Found
from armloop.diagnosis import close
from armloop.diagnosis import diagnose as run
from armloop.diagnosis.compensation import Closing
from armloop.model import AddedEffect, ReconstructedModel
from armloop.reports.diagnosis_tables import diagnosis_table
from armloop.util.errors import InputError
from armloop.util.files import write_json, write_text
from armloop.util.given import path_of, require
from armloop.util.progress import Progress, silent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Diagnosis:
    """The verdict on a run.

    Attributes:
        verdict: "no_effect", "effects_found", "unlisted_effect" or "cannot_tell".
        effects: what was found, each with ``.effect`` (its ``name``, ``joint``), ``.parameters`` (by name: ``value``,
            ``std_error``, ``unit``) and ``.torque(context)``.
        laws: laws that are in no catalogue, as effects are; the model has them if they were adopted.
        model: the model with the effects found.
        error: RMSE per joint on data not fitted: ``before``, ``after``, ``noise_floor``; NaN for a joint that did not move.
        before: the model that was diagnosed.
        logs: names of the logs that this is said of; of others, in which the arm was not the same, ``apart`` has diagnoses.
    """

    def __init__(self, found: Found, before: ReconstructedModel, compensation: Closing) -> None:
        self._found, self._compensation = found, compensation
        self.before = Model.of(before)
        self.verdict: str = found.verdict
        self.model = Model.of(found.model)
        self.effects: list[AddedEffect] = list(found.model.effects[len(before.effects) :])
        self.laws: list[AddedEffect] = [each for law in found.laws for each in law.added()]
        self.error: dict[str, Any] = found.errors()
        self.logs = list(found.logs)

    @cached_property
    def apart(self) -> list[Diagnosis]:
        """Diagnoses of logs in which the arm was not the same."""
        plain = self.before.plain()
        return [
            Diagnosis(each, self.before, close(plain, each.model, each.samples)) for each in self._found.apart
        ]

    def to_dict(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        return {**self._found.to_dict(), **self._compensation.to_dict()}

    def report(self, path: str | Path) -> Path:
        """Write the page of ``armloop diagnose``, without a network; raises ``InputError`` if it cannot be written."""
        from armloop.reports.diagnosis_report import diagnosis_report

        write_text(path, diagnosis_report(self._found, self.before, self._compensation))
        return Path(path)

    def save(self, folder: str | Path) -> Path:
        """Write what ``armloop diagnose --out`` does: diagnosis.json, model.json (augmented), report.html."""
        place = path_of(folder, "the folder")
        write_json(place / "diagnosis.json", self.to_dict())
        self.model.save(place / "model.json")
        self.report(place / "report.html")
        return place

    def plot(self) -> Figure:
        """The residual of the strongest joint over time, before and after, a matplotlib figure."""
        from armloop.reports.plots import residual_time_figure

        return displayed(residual_time_figure(self._found))

    def __repr__(self) -> str:
        found = ", ".join(self._found.labels)
        return f"<armloop.Diagnosis {self.verdict}{': ' + found if found else ''}>"

    def __str__(self) -> str:
        return diagnosis_table(self._found, self._compensation)

    def _repr_html_(self) -> str:
        return page(str(self), self.plot())


def diagnose(
    model: ReconstructedModel,
    logs: MotionLog | Sequence[MotionLog],
    *,
    held_out: MotionLog | Sequence[MotionLog] = (),
    adopt: bool = Command.adopt,
    jobs: int | None = Command.jobs,
    progress: Progress = silent,
) -> Diagnosis:
    """Find what a model lacks on a measured run, trace it to a physical effect, and add it; see ``armloop diagnose``.

    Args:
        logs: the run, or several of the same arm: judged together, and apart where the arm was not the same in all.
        held_out: further runs of the arm as it is now, never fitted: error before and after on each.
        adopt: put an unlisted law that was found into the model; it acts where the run has been.
        jobs: processes that try the hypotheses; up to four cores by default. The answer does not depend on it.

    Raises:
        InputError: a log does not fit the model.
    """
    Command.checked(adopt=adopt, jobs=jobs)
    require("a function", progress=progress)
    runs, after = (logs_for(model, as_logs(each)) for each in (logs, held_out))
    require_some(runs)
    require_not_fitted(after, runs, [log.name for log in after])
    if jobs is not None and not 1 <= jobs <= MOST_PROCESSES:
        raise InputError(
            f"jobs {jobs}: give 1 or more processes, at most {MOST_PROCESSES}, or None for as many as there are cores"
        )
    plain = Model.of(model).plain()
    found = run(plain, runs, progress, jobs)
    found = found.adopt() if adopt else found
    compensation = close(plain, found.model, found.samples, after)
    return Diagnosis(found, model, compensation)
