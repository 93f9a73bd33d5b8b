"""What the items of one run share: how much is drawn, processes, results that two items need, progress."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from armloop.util.progress import Progress, silent
from armloop.util.workers import Pool

Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclass
class Context:
    """One run of the reproduction."""

    draws: int = 10  # noise draws per case
    reading_draws: int = 2  # noise draws per reading of the recipe that is not the default
    seeds: int = 5  # collections of the tracking experiment
    starts: int = 20  # random starts of k-means
    repeats: int = 20  # of a short timing, of which the best counts
    processes: int = 2  # how many work at once, forked, with one BLAS thread each; 1 works here
    progress: Progress = silent  # told where the run stands
    _shared: dict[object, Any] = field(default_factory=dict)

    def once(self, key: object, make: Callable[[], Result]) -> Result:
        """The result of `make`, computed the first time that its key is asked for."""
        if key not in self._shared:
            self._shared[key] = make()
        return self._shared[key]

    def map(self, function: Callable[[Job], Result], jobs: Sequence[Job], what: str) -> list[Result]:
        """Apply a module's function to each job, in order of the jobs."""
        results: list[Result] = []
        if self.processes <= 1 or len(jobs) == 1:
            with threadpool_limits(1):
                return [function(job) for job in jobs]
        with Pool(self.processes) as pool:
            for k, result in enumerate(pool.map(function, jobs)):
                results.append(result)
                self.progress(f"{what}: {k + 1} of {len(jobs)}")
        return results
