"""Watch many logs of many arms over time."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, TextIO

from armloop.commands.arguments import Json, processes
from armloop.commands.options import flag, option, required, whole
from armloop.util.errors import InputError
from armloop.util.outputs import take_file

if TYPE_CHECKING:
    from armloop.watch.sources import LogFile

HELP = "watch many logs of many arms over time: alarms with a stated false alarm rate, then a diagnosis"
EXAMPLE = "armloop watch --models models --logs logs --store store --report watch.html"
#: Exit status when there is an alarm that was not told before.
NEW_ALARM = 3


def _hours(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is no time; give a positive number of hours")
    return value


class Watch(Json):
    """The options."""

    models: str = required("folder with ARM.json or ARM/model.json, or one model for all", metavar="DIR")
    logs: list[str] = required(
        "folders with ARM/[PROGRAMME/]LOG, or logs (the arm is their folder), or - for paths line by line from standard "
        "input; columns arm, programme, temperature[1..n] in °C and since_start in s are used where they are",
        nargs="+",
        metavar="DIR",
    )
    store: str = required("folder that keeps sums, tests and alarms; made if it is not there", metavar="DIR")
    false_alarm_hours: float = option(
        "promised mean time between false alarms of one whole arm, hours of operation (default: %(default)g)",
        1000.0,
        metavar="H",
        type=_hours,
    )
    healthy: int = option(
        "the first N units of an arm (a log, or ten minutes of a long one) are known to be healthy: how warmth matters is "
        "learned there (default: %(default)s)",
        20,
        metavar="N",
        type=whole(1, 10**9, "no number of them; give a whole number from 1"),
    )
    sums_only: bool = flag(
        "name a change from the store's sums alone, without a diagnosis of the logs themselves"
    )
    report: str | None = option("write one self-contained page", metavar="HTML")
    arm: str | None = option("whose trends the page shows (default: the arm of the newest alarm)")
    scheduler: str | None = option("map over a Dask cluster, such as tcp://10.0.0.7:8786", metavar="ADDRESS")
    jobs: int = processes("watch arms side by side on this machine (default: %(default)s)", 1)


def run(options: Watch) -> int:
    """Watch; the exit status is 3 if there is a new alarm; raises ``InputError`` where every log was set aside."""
    import sys
    from dataclasses import replace

    from armloop.commands.shared import print_json, progress
    from armloop.util.files import write_text
    from armloop.watch import Options, watch
    from armloop.watch.ingest import Counts

    if options.arm is not None and options.report is None:
        raise InputError("--arm chooses whose trends the page of --report shows: give it, too")
    take_file(options.report, "--report")
    how = Options(
        options.false_alarm_hours, options.healthy, not options.sums_only, options.scheduler, options.jobs
    )
    tell = progress(options)
    told: list[str] = []
    diagnosed: list[str] = []
    counts = Counts()
    for places in _batches(sys.stdin) if options.logs == ["-"] else [options.logs]:
        files = _found(places, options.store, options.logs == ["-"])
        if options.arm is not None and options.logs != ["-"]:
            _require_arm(options.arm, files, options.store)
        outcome = watch(options.models, files, options.store, how, tell)
        if not options.json:
            from armloop.reports.watch_tables import watch_words

            print(watch_words(outcome), flush=True)
            _announce(options.store, outcome.new)
        told += outcome.new
        diagnosed += outcome.diagnosed
        counts += outcome.counts
    outcome = replace(outcome, counts=counts, diagnosed=diagnosed)
    if options.report is not None:
        from armloop.reports.watch_report import watch_report

        write_text(options.report, watch_report(outcome, options.models, options.store, options.arm, how))
    if options.json:
        print_json({**outcome.to_dict(), "new": [alarm for alarm in outcome.alarms if alarm["id"] in told]})
        sys.stdout.flush()
        _announce(options.store, told)
    elif options.report is not None:
        print(f"written: {options.report}")
    if not told and counts.aside and not counts.read + counts.known:
        raise InputError(
            f"every log of this call was set aside, none is watched ({counts.aside}); the reasons stand above and in "
            f"{options.store}"
        )
    return NEW_ALARM if told else 0


def _found(places: Sequence[str], store: str, listed: bool) -> list[LogFile]:
    """The logs in these places; that there are none is said: to a job that looks at the status alone, all would be well.

    Args:
        listed: the places came on standard input.

    Raises:
        InputError: there are none, and the store has none, either.
    """
    from pathlib import Path

    from armloop.util.doubts import warn
    from armloop.watch.sources import find_logs

    files = find_logs(places, listed)
    if not files:
        where = ", ".join(places) or "standard input"
        said = f"{where}: holds no log; --logs takes DIR/ARM/*.csv or *.parquet, or - for a list of them"
        if not any(Path(store).glob("sums/*/*/*.parquet")):
            raise InputError(said)
        warn(said)
    return files


def _require_arm(arm: str, files: Sequence[LogFile], store: str) -> None:
    """Raise ``InputError`` for an arm whose trends nothing will show, before the logs are read."""
    from pathlib import Path

    from armloop.watch.store import arms_in

    known = {*arms_in(Path(store)), *(file.arm for file in files)}
    if "" in known or arm in known:  # of a log in no arm's folder a column may tell
        return
    names = ", ".join(sorted(known)[:12]) + (", ..." if len(known) > 12 else "")
    raise InputError(f"--arm {arm}: there is no such arm among the logs or in the store; there are {names}")


def _announce(store: str, names: Sequence[str]) -> None:
    """After they were told: a call that is killed before tells them again."""
    from armloop.watch.store import Store

    if names:
        Store(store).announce(names)


def _batches(stream: TextIO | None) -> Iterator[list[str]]:
    """Paths that standard input brings, as many at a time as there are; nothing, once, if it ends without any."""
    import os
    import select

    if stream is None:  # it was closed
        yield []
        return
    # by its number: what a text stream has read ahead, `select` does not see
    source, text, ended, any_yet = stream.fileno(), b"", False, False
    while not ended:
        read = os.read(source, 65536)
        text, ended = text + read, not read
        if not ended and select.select([source], [], [], 0.2)[0]:
            continue
        *whole, text = (*text.split(b"\n"), b"") if ended else text.split(b"\n")
        waiting = [path for line in whole if (path := os.fsdecode(line).strip())]
        if waiting or (ended and not any_yet):
            any_yet = True
            yield waiting
