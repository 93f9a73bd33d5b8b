"""Trace what a model lacks on a run."""

from __future__ import annotations

from armloop.commands.arguments import HeldOut, Json, OfModel, processes
from armloop.commands.next_run import NextRun
from armloop.commands.options import flag, required
from armloop.util.outputs import take_folder

HELP = "find what a model lacks on a measured run, trace it to a physical effect, and add it"
EXAMPLE = "armloop diagnose model.json run.csv --out out/diagnosis"


class Diagnose(HeldOut, OfModel, NextRun, Json):
    """The options."""

    out: str = required("folder for diagnosis.json, model.json (augmented), report.html")
    adopt: bool = flag(
        "put an unlisted law that was found into the augmented model and its feedforward; it acts where the run has been "
        "and fades outside of that"
    )
    jobs: int | None = processes(
        "try the hypotheses, and draw the report (default: one per core, at most four); the answer does not depend on it"
    )


def run(options: Diagnose) -> None:
    """Trace what a model lacks on a run."""
    from armloop.commands.next_run import plan, wish
    from armloop.commands.shared import held_out_logs, model_and_logs, print_json, progress
    from armloop.diagnosis import close
    from armloop.diagnosis import diagnose as run
    from armloop.reports.diagnosis_report import diagnosis_report
    from armloop.reports.diagnosis_tables import diagnosis_table
    from armloop.util.files import write_json, write_text

    folder = take_folder(options.out, ("diagnosis.json", "model.json", "report.html"))
    model, logs = model_and_logs(options)
    held_out = held_out_logs(options, model, logs)
    wanted = wish(options, model)
    result = run(model, logs, progress(options), options.jobs)
    result = result.adopt() if options.adopt else result
    compensation = close(model, result.model, result.samples, held_out)
    answer = {**result.to_dict(), **compensation.to_dict()}
    planned = None if wanted is None else plan(str(options.next_run), result, wanted, progress(options))
    if planned is not None:
        answer["next_run"] = planned.to_dict()
    progress(options)("drawing the report")
    page = diagnosis_report(result, model, compensation, options.jobs)
    write_json(folder / "diagnosis.json", answer)
    result.model.save(folder / "model.json")
    write_text(folder / "report.html", page)
    if planned is not None:
        planned.write()
    if options.json:
        print_json(answer)
        return
    print(diagnosis_table(result, compensation))
    if planned is not None:
        print("\n" + planned.words())
    what = "augmented" if len(result.model.effects) > len(model.effects) else "as it was"
    print(f"\nwritten: {folder}/diagnosis.json, model.json ({what}), report.html")
