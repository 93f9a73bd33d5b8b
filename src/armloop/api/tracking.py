"""Controllers compared in closed loop, as an object."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armloop.api.reading import require_model
from armloop.api.shown import displayed, page
from armloop.model import ReconstructedModel
from armloop.reports.tables import eta_table
from armloop.reports.tracking_tables import metrics_table, not_run
from armloop.robot.arm import Arm
from armloop.util.errors import InputError
from armloop.util.given import path_of, require
from armloop.util.progress import Progress, silent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armloop.drake.control.reference import ReferenceLike
    from armloop.drake.experiments.tracking import TrackingResult


class Tracking:
    """How the controllers of a scenario tracked.

    Attributes:
        results: by controller: ``time``, ``q_ref``, ``q``, ``tau`` arrays, ``eta`` (n,) in ``unit`` (deg, mm), and
            ``log``, what the arm's own sensors said, for :func:`diagnose`.
    """

    def __init__(self, answer: dict[str, Any], results: Mapping[str, TrackingResult], paper: bool) -> None:
        self._answer, self._paper = answer, paper
        self.results = dict(results)

    @property
    def eta(self) -> dict[str, list[float]]:
        """Mean absolute tracking error per joint by controller, deg (mm)."""
        return {name: [float(x) for x in result.eta] for name, result in self.results.items()}

    def to_dict(self) -> dict[str, Any]:
        """The content of ``tracking.json``."""
        return dict(self._answer)

    def plot(self) -> Figure:
        """Reference, positions and errors of each joint, a matplotlib figure."""
        from armloop.reports.plots import tracking_figure

        return displayed(tracking_figure(self.results))

    def report(self, path: str | Path) -> Path:
        """Write the figure and the tables as a page of its own, without a network."""
        from armloop.util.files import write_text

        head = (
            '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Tracking</title></head><body>'
        )
        write_text(path, f"{head}{self._repr_html_()}</body></html>\n")
        return Path(path)

    def __repr__(self) -> str:
        parts = (f"{name} {'/'.join(f'{x:.3g}' for x in eta)}" for name, eta in self.eta.items())
        return f"<armloop.Tracking η: {', '.join(parts)}>"

    def __str__(self) -> str:
        tables = [eta_table(self.results, paper=self._paper), metrics_table(self.results)]
        return "\n\n".join(map(str, [*tables, *not_run(self._answer)]))

    def _repr_html_(self) -> str:
        return page(str(self), self.plot())


def track(
    scenario: str | Path,
    model: ReconstructedModel | Mapping[str, ReconstructedModel] | None = None,
    *,
    arm: str | Path | Arm | None = None,
    reference: str | Path | ReferenceLike | None = None,
    out: str | Path | None = None,
    progress: Progress = silent,
) -> Tracking:
    """Compare controllers in closed loop in Drake; see ``armloop track``.

    Args:
        scenario: a built-in name, a YAML file, or FILE:NAME.
        model: serves all controllers of the scenario; or several by name, as ``--model NAME=…``. Without any, one is
            reconstructed first from data collected on the scenario's arm, if a controller needs one.
        arm: the URDF of a scenario that leaves its arm open, or an arm of ``load_arm``, such as with ``tip``.
        reference: a motion in place of the scenario's, all of it scored: of :func:`excite`, or its file; a Drake
            trajectory.
        out: folder for tracking.json, tracking.png, replay.html and logs/NAME.csv of each controller.

    Raises:
        InputError: the scenario is wrong or of another kind (payload_pickup, friction_wear: use the command), or the
            model is of another arm, or serves no controller.
    """
    from armloop.drake.experiments.scenarios import load_tracking
    from armloop.workflows import run_scenario

    require("a function", progress=progress)
    plan = load_tracking(scenario, arm, reference)
    if plan.pickup is not None or plan.wear is not None:
        raise InputError(f"{scenario}: is of a kind of its own; run `armloop track {scenario}`")
    models = _by_name(model)
    for name, each in models.items():
        each.arm.require_same(plan.plant.arm, f"model {name}")
    answer, results = run_scenario(plan, models, None if out is None else path_of(out, "out"), progress)
    paper = reference is None and plan.name.startswith("three_axis_tracking")
    return Tracking(answer, results, paper)


def _by_name(
    model: ReconstructedModel | Mapping[str, ReconstructedModel] | None,
) -> dict[str, ReconstructedModel]:
    """The models by name; raises ``InputError`` for what is none, or a name that controllers cannot have."""
    if model is None:
        return {}
    if not isinstance(model, Mapping):
        require_model(model)
        return {"model": model}
    for name, each in model.items():
        if not (isinstance(name, str) and name.replace("_", "").isalnum()):
            raise InputError(f"model {name!r:.60}: a name has letters, digits and _ only, such as step3")
        if name == "exact":
            raise InputError("model 'exact': is the simulated arm's own model; choose another name")
        require_model(each)
    return dict(model)
