"""Watching: new logs into the store, every arm tested, every alarm explained."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armloop.util.errors import InputError
from armloop.util.progress import Progress, paced, silent
from armloop.util.workers import Cluster, Processes, Serial, Workers
from armloop.watch.fleet import find_models, model_and_digest, model_for
from armloop.watch.ingest import Counts, ingest
from armloop.watch.running import stored
from armloop.watch.sources import LogFile
from armloop.watch.store import Store
from armloop.watch.verdicts import Options, Task, test_arm

SCHEMA = "armloop/watch/1"


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a call came to.

    Attributes:
        counts: of the logs that were given.
        arms: what the tests of each arm came to (``tested/arm=A.json``).
        alarms: all alarms in the store, by time.
        new: identifiers of those that were never told.
        aside: logs set aside, with their reasons.
    """

    counts: Counts
    arms: list[dict[str, Any]]
    alarms: list[dict[str, Any]]
    new: list[str]
    aside: list[dict[str, Any]]
    hours: float

    def to_dict(self) -> dict[str, Any]:
        """The answer of ``--json``."""
        return {
            "schema": SCHEMA,
            "logs": {"read": self.counts.read, "known": self.counts.known, "set_aside": self.counts.aside},
            "arms": [
                {
                    key: arm[key]
                    for key in ("arm", "logs", "units", "hours", "limit", "warmth", "alarms", "notes")
                }
                for arm in self.arms
            ],
            "operation_hours": sum(arm["hours"] for arm in self.arms),
            "promise": {
                "false_alarm_hours": self.hours,
                "of": "one whole arm, all joints and effects together",
            },
            "new": [alarm for alarm in self.alarms if alarm["id"] in self.new],
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
        counts, places = ingest(folder, known, files, workers, progress)
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
        tell, arms = paced(progress), []
        for answer in workers.map(test_arm, tasks) if tasks else ():
            arms.append(answer)
            tell(f"tested {len(arms)} of {len(tasks)} arms")
        alarms = folder.alarms()
        told = folder.announced()
        new = [alarm["id"] for alarm in alarms if alarm["id"] not in told]
        return Outcome(counts, arms, alarms, new, folder.aside(), options.hours)


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
