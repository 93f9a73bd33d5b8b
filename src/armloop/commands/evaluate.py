"""Score a model on logs."""

from __future__ import annotations

import argparse

from armloop.commands.arguments import add_chain, add_json, add_logs, add_recorded

HELP = (
    "compare a model's prediction with logs: RMSE and nRMSE (RMSE over RMS of the measured signal) per joint"
)
EXAMPLE = "armloop evaluate model.json run.csv"


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    p.add_argument("model", metavar="MODEL.json")
    add_logs(p)
    p.add_argument("--arm", default=None, help="refuse the model unless it was made for this arm")
    add_chain(p)
    add_recorded(p, "as the model's training logs")
    add_json(p)


def run(options: argparse.Namespace) -> None:
    """Score a model on logs."""
    from armloop.commands.shared import model_and_logs, print_json
    from armloop.data.signals import preprocess
    from armloop.identification.scoring import score
    from armloop.reports.tables import score_table

    model, logs = model_and_logs(options)
    result = score(model, preprocess(logs, model.conditioning))
    if options.json:
        print_json(result.to_dict())
        return
    print(score_table(result, model.arm))
