"""The option of a diagnosis to write the motion to make next."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from armloop.commands.options import option
from armloop.commands.ranges import Ranges, acceleration, ranges, ranges_stated, read_ranges
from armloop.util.errors import InputError

if TYPE_CHECKING:
    from armloop.diagnosis import Diagnosis
    from armloop.diagnosis.next_run import NextRun as Next
    from armloop.diagnosis.next_run import Wish
    from armloop.model import ReconstructedModel
    from armloop.util.progress import Progress

#: Rows per second of the reference.
_RATE = 500.0


class NextRun(Ranges):
    """``--next-run`` and what it may do."""

    group = "the motion to make next"

    next_run: str | None = option(
        "write a reference that tells what was found from its alternatives, as far as a motion can; without any, one that "
        "measures it better, or, for an unlisted effect, one that shows its joint at all postures and speeds",
        metavar="REF.csv",
    )
    next_run_duration: float | None = option(
        "s, rounded up to whole periods of 20 s (default: 60)", metavar="S"
    )
    ranges: str | None = ranges("those of the model's training data")
    acceleration: str | None = acceleration("default: as in the model's training data")


def wish(options: NextRun, model: ReconstructedModel) -> Wish | None:
    """What the options say of the motion; None if none is wanted. Faults are found before any work is done."""
    from armloop.commands.shared import take_reference
    from armloop.diagnosis.next_run import Wish, training_ranges

    if options.next_run is None:
        duration_stated = options.next_run_duration is not None
        if ranges_stated(options) or options.reserve != Ranges.reserve or duration_stated:
            raise InputError("ranges, reserve and duration are those of --next-run REF.csv: give it, too")
        return None
    take_reference(options.next_run, "--next-run")
    duration = 60.0 if options.next_run_duration is None else options.next_run_duration
    known = training_ranges(model)
    stated = read_ranges(options, model.arm, "urdf", known) if ranges_stated(options) else known
    wanted = Wish(stated, options.reserve, duration)
    wanted.check(model)
    return wanted


class Planned(NamedTuple):
    """The answer of ``--next-run``: the motion, or why there is none."""

    path: str
    run: Next | None
    fault: str = ""

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        if self.run is None:
            return {"reference": None, "why": self.fault or _NOTHING}
        return {"reference": self.path, **self.run.to_dict()}

    def write(self) -> None:
        """Write the reference, if there is one."""
        from armloop.experiment.excitation import write_reference

        if self.run is not None:
            write_reference(self.path, self.run.reference, _RATE)

    def words(self) -> str:
        """What the motion is for, for a terminal."""
        if self.fault:
            return f"No motion to make next with what was found: {self.fault}."
        return _NOTHING if self.run is None else _words(self.path, self.run)


_NOTHING = (
    "No motion to make next: the run shows no effect of the arm that one could tell more about; `armloop excite` designs "
    "an exciting one."
)


def plan(path: str, diagnosis: Diagnosis, wanted: Wish, tell: Progress) -> Planned:
    """Design the motion. A diagnosis is not lost where the limits exclude any."""
    from armloop.diagnosis.next_run import next_run

    try:
        return Planned(path, next_run(diagnosis, wanted, tell))
    except InputError as error:
        return Planned(path, None, str(error))


def _words(path: str, run: Next) -> str:
    from armloop.diagnosis.next_run import FAR_ENOUGH
    from armloop.reports.tables import make_table
    from armloop.reports.words import effect_label, number, percent, wrapped

    table, lines = "", []
    told = [each for each in run.told if each.then is not None]
    if told:
        title = "The motion to make next: how much of the one's torque the other cannot stand for"
        rows = [
            [effect_label(each.found), effect_label(each.rival), percent(each.now), percent(each.then)]
            for each in told
        ]
        table = f"{make_table(['found', 'alternative', 'this run', 'next run'], rows, title, (0, 1))}\n"
    if run.purpose == "precision":
        for effect, factor in run.sharper:
            result = (
                f"measures {effect_label(effect)} with {number(factor, 2)} times the standard error of this run"
                if factor < 0.95
                else f"measures {effect_label(effect)} no better than this run did: the limits leave little to gain"
            )
            lines.append(f"The motion to make next {result}.")
    if run.purpose == "unlisted":
        lines.append(
            f"The motion to make next takes joint {run.joint}, where no listed law explains the residual, through all its "
            "postures and speeds, the others moving apart from it."
        )
    for each in run.told:
        names = f"{effect_label(each.found)}, from {effect_label(each.rival)}"
        if each.then is None:
            lines.append(f"No motion within the limits tells {names}.")
        elif each.then < FAR_ENOUGH:
            lines.append(
                f"Even this motion hardly tells {names}: wider limits or a longer --next-run-duration may."
            )
    lines.append(
        f"Reference written to {path}, {number(run.reference.duration)} s. It knows nothing of obstacles, nor of the arm "
        f"hitting itself: watch it in slow motion first (`armloop track SCENARIO --reference {path}` in simulation)."
    )
    return table + "\n".join(map(wrapped, lines))
