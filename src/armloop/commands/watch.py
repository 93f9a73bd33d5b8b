"""Watch many logs of many arms over time."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TextIO

from armloop.commands.arguments import add_jobs, add_json

if TYPE_CHECKING:
    from armloop.watch.store import Store

HELP = "watch many logs of many arms over time: alarms with a stated false alarm rate, then a diagnosis"
EXAMPLE = "armloop watch --models models --logs logs --store store --report watch.html"
#: Exit status when there is an alarm that was not told before.
NEW_ALARM = 3


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    p.add_argument(
        "--models",
        required=True,
        metavar="DIR",
        help="folder with ARM.json or ARM/model.json, or one model for all",
    )
    p.add_argument(
        "--logs",
        required=True,
        nargs="+",
        metavar="DIR",
        help="folders with ARM/[PROGRAMME/]LOG, or logs (the arm is their folder), or - for paths line by line from "
        "standard input; columns arm, programme, temperature[1..n] in °C and since_start in s are used where they are",
    )
    p.add_argument(
        "--store",
        required=True,
        metavar="DIR",
        help="folder that keeps sums, tests and alarms; made if it is not there",
    )
    p.add_argument(
        "--false-alarm-hours",
        type=_hours,
        default=1000.0,
        metavar="H",
        help="promised mean time between false alarms of one whole arm, hours of operation (default: 1000)",
    )
    p.add_argument(
        "--healthy",
        type=_count,
        default=20,
        metavar="N",
        help="the first N logs of an arm are known to be healthy: how warmth matters is learned there (default: 20)",
    )
    p.add_argument(
        "--sums-only",
        action="store_true",
        help="name a change from the store's sums alone, without a diagnosis of the logs themselves",
    )
    p.add_argument("--report", default=None, metavar="HTML", help="write one self-contained page")
    p.add_argument(
        "--arm", default=None, help="whose trends the page shows (default: the arm of the newest alarm)"
    )
    p.add_argument(
        "--scheduler",
        default=None,
        metavar="ADDRESS",
        help="map over a Dask cluster, such as tcp://10.0.0.7:8786",
    )
    add_jobs(p, "watch arms side by side on this machine (default: 1)", 1)
    add_json(p)


def run(options: argparse.Namespace) -> int:
    """Watch; the exit status is 3 if there is a new alarm."""
    import sys

    from armloop.commands.shared import out_file, print_json, progress
    from armloop.util.files import write_text
    from armloop.watch import Options, watch
    from armloop.watch.sources import find_logs
    from armloop.watch.store import Store as Folder

    out_file(options.report, "--report")
    how = Options(
        options.false_alarm_hours, options.healthy, not options.sums_only, options.scheduler, options.jobs
    )
    tell = progress(options)
    told: list[str] = []
    outcome = None
    batches = _batches(sys.stdin) if options.logs == ["-"] else iter([options.logs])
    for places in batches:
        outcome = watch(options.models, find_logs(places), options.store, how, tell)
        if not options.json:
            from armloop.reports.watch_tables import watch_words

            print(watch_words(outcome), flush=True)
            _announce(Folder(options.store), outcome.new)
        told += outcome.new
    if outcome is None:
        outcome = watch(options.models, [], options.store, how, tell)
    if options.report is not None:
        from armloop.reports.watch_report import watch_report

        write_text(options.report, watch_report(outcome, options.models, options.store, options.arm, how))
    if options.json:
        print_json({**outcome.to_dict(), "new": [alarm for alarm in outcome.alarms if alarm["id"] in told]})
        sys.stdout.flush()
        _announce(Folder(options.store), told)
    elif options.report is not None:
        print(f"written: {options.report}")
    return NEW_ALARM if told else 0


def _announce(store: Store, names: Sequence[str]) -> None:
    """After they were told: a call that is killed before tells them again."""
    if names:
        store.announce(names)


def _batches(stream: TextIO) -> Iterator[list[str]]:
    """Paths that standard input brings, as many at a time as there are."""
    import select

    waiting: list[str] = []
    for line in stream:
        if line.strip():
            waiting.append(line.strip())
        if waiting and not select.select([stream], [], [], 0.2)[0]:
            yield waiting
            waiting = []
    if waiting:
        yield waiting


def _hours(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is no time; give a positive number of hours")
    return value


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of them; give a whole number from 1")
    return int(text)
