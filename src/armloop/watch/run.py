"""Watching: new logs into the store, every arm tested, every alarm explained."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from armloop.util.errors import InputError
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import Cluster, Processes, Serial, Workers
from armloop.watch.fleet import find_models, model_and_digest, model_for
from armloop.watch.ingest import Counts, ingest
from armloop.watch.running import stored
from armloop.watch.sources import LogFile
from armloop.watch.store import SCHEMA, Store
from armloop.watch.verdicts import Options, Task, test_arm


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a call came to.

    Attributes:
        counts: of the logs that were given.
        arms: what the tests of each arm came to (``tested/arm=A.json``).
        alarms: all alarms in the store that stand, by time.
        new: identifiers of those that were never told.
        diagnosed: identifiers of those that were told before, and whose logs were diagnosed in this call.
        aside: logs set aside, with their reasons.
    """

    counts: Counts
    arms: list[dict[str, Any]]
    alarms: list[dict[str, Any]]
    new: list[str]
    aside: list[dict[str, Any]]
    hours: float
    diagnosed: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``--json``."""
        return {
            "schema": SCHEMA,
            "logs": {"read": self.counts.read, "known": self.counts.known, "set_aside": self.counts.aside},
            "arms": [
                {
                    key: arm[key]
                    for key in (
                        "arm",
                        "logs",
                        "units",
                        "units_since_alarm",
                        "units_for_alarm",
                        "hours",
                        "limit",
                        "warmth",
                        "alarms",
                        "notes",
                    )
                }
                for arm in self.arms
            ],
            "operation_hours": sum(arm["hours"] for arm in self.arms),
            "promise": {
                "false_alarm_hours": self.hours,
                "of": "one whole arm, all joints and effects together",
            },
            "new": [alarm for alarm in self.alarms if alarm["id"] in self.new],
            "diagnosed": [alarm for alarm in self.alarms if alarm["id"] in self.diagnosed],
            "alarms": [alarm["id"] for alarm in self.alarms],
            "set_aside": self.aside,
        }


def watch(
    models: str | Path,
    files: Sequence[LogFile],
    store: str | Path,
    options: Options | None = None,
    progress: Progress = silent,
) -> Outcome:
    """Bring logs into the store, test every arm that has new ones, and say what changed.

    The caller tells the new alarms and then calls :meth:`armloop.watch.store.Store.announce`: a call that is killed
    before that tells them again.

    Raises:
        InputError: models or store cannot be used, or no scheduler answers.
    """
    options = options or Options()
    known = find_models(models)
    with contextlib.ExitStack() as held:
        # what is wrong with them is said before a store is made
        workers = held.enter_context(contextlib.closing(_workers(options)))
        folder = Store(store)
        held.enter_context(_leaving_nothing(folder))
        held.enter_context(folder.locked(options.scheduler is not None))
        counts, places, closed = ingest(folder, known, files, workers, progress)
        kept = {log for log, _ in folder.known()}
        places = {log: path.resolve() for log, path in places.items() if log in kept}
        tasks = []
        for arm in folder.arms():
            path = model_for(known, arm)
            if path is None:
                continue
            digest = model_and_digest(path)[1]
            own = stored(folder, arm, digest)
            if own:
                mine = {log: place for log, place in places.items() if log in own}
                tasks.append(Task(folder.folder, arm, path, mine, options))
        if tasks:
            progress(
                "testing the arms with new logs; what an alarm is about is diagnosed, which may take minutes"
            )
        tell, arms, before = paced(progress), [], _diagnosed(folder)
        for answer in workers.map(test_arm, tasks) if tasks else ():
            arms.append(answer)
            tell(f"tested {len(arms)} of {len(tasks)} arms")
        alarms = _standing(folder.alarms(), arms)
        told, after = folder.announced(), _diagnosed(folder) - before
        new = [alarm["id"] for alarm in alarms if alarm["id"] not in told]
        late = [alarm["id"] for alarm in alarms if alarm["id"] in told & after]
        return Outcome(counts, arms, alarms, new, [*closed, *folder.aside()], options.hours, late)


def _standing(alarms: list[dict[str, Any]], arms: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The alarms without those of a time that has been tested anew, with another model or other options, or late logs.

    What the present tests do not go back to (an arm that is tested no more, logs that are gone) stands as it was found.
    """
    tested = {arm["arm"]: arm for arm in arms}
    return [
        alarm
        for alarm in alarms
        if (own := tested.get(alarm["arm"])) is None
        or alarm["id"] in own["alarms"]
        or alarm["when"] < own["first"]
    ]


def _diagnosed(store: Store) -> set[str]:
    """Identifiers of the alarms whose logs were diagnosed."""
    return {alarm["id"] for alarm in store.alarms() if "logs" in alarm.get("diagnosis", {})}


@contextlib.contextmanager
def _leaving_nothing(store: Store) -> Iterator[None]:
    try:
        yield
    except InputError:
        store.give_up()
        raise


def _workers(options: Options) -> Workers:
    if options.scheduler is not None:
        return Cluster(options.scheduler)
    return Serial() if options.jobs == 1 else Processes(options.jobs)
