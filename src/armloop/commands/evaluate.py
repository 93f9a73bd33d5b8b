"""Score a model on logs."""

from __future__ import annotations

from armloop.commands.arguments import Json, OfModel

HELP = (
    "compare a model's prediction with logs: RMSE and nRMSE (RMSE over RMS of the measured signal) per joint"
)
EXAMPLE = "armloop evaluate model.json run.csv"


class Evaluate(OfModel, Json):
    """The options."""


def run(options: Evaluate) -> None:
    """Score a model on logs."""
    from armloop.commands.shared import model_and_logs, print_json
    from armloop.data.repeats import require_different
    from armloop.data.signals import preprocess
    from armloop.identification.scoring import score
    from armloop.reports.tables import ALL_COUNT, score_table
    from armloop.reports.words import wrapped
    from armloop.robot.plausibility import say_implausible
    from armloop.util.doubts import warn
    from armloop.util.errors import InputError

    model, logs = model_and_logs(options)
    # here, for it needs what takes longer to import than a fault of the input to be told
    from armloop.identification.validation.misrecorded import misrecorded, turned_joints

    require_different(logs)
    say_implausible(model.arm, logs)
    samples = preprocess(logs, model.conditioning)
    if not samples.tau.any():
        raise InputError(
            f"{logs[0].name}: every tau is zero throughout; give a log that holds the joints' torques"
        )
    whole = misrecorded(model, samples)
    for wrong in [whole] if whole else turned_joints(model, samples):
        warn(f"{', '.join(log.name for log in logs)}: {wrong}")
    result = score(model, samples)
    if options.json:
        print_json(result.to_dict())
        return
    print(score_table(result, model.arm, units=model.torque_units), wrapped(ALL_COUNT), sep="\n")
