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
    from armloop.identification.scoring import of_slow_motion, score
    from armloop.reports.tables import ALL_COUNT, score_by_log, score_table
    from armloop.reports.words import wrapped
    from armloop.robot.plausibility import say_implausible

    model, logs = model_and_logs(options)
    # here, for it needs what takes longer to import than a fault of the input to be told
    from armloop.identification.validation.misrecorded import say_misrecorded

    require_different(logs)
    say_implausible(model.arm, logs)
    samples = preprocess(logs, model.conditioning)
    say_misrecorded(model, samples, [log.name for log in logs])
    result = score(model, samples)
    # of several logs one may be of an arm that has changed
    apart = logs if len(logs) > 1 else []
    each = [(log.name, score(model, preprocess([log], model.conditioning))) for log in apart]
    if options.json:
        by_log = [{"log": name, **one.to_dict()} for name, one in each]
        print_json({**result.to_dict(), **({"logs": by_log} if each else {})})
        return
    print(score_table(result, model.arm, units=model.torque_units), wrapped(ALL_COUNT), sep="\n")
    if each:
        print("", score_by_log(each, model.arm), sep="\n")
    for words in of_slow_motion(model, samples):
        print(wrapped(f"note: {words}"))
