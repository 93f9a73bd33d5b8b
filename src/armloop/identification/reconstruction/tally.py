"""Held-out prediction error of a model, summed chunk by chunk."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from armloop.data.blocks import block_numbers
from armloop.data.creep import creeping
from armloop.data.motion import Samples
from armloop.data.reversals import at_reversals, passing
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.scoring import (
    Score,
    error_sums,
    errors_of,
    ratios,
    residual,
    root_mean,
    score_of_sums,
    too_slow,
)
from armloop.model import ReconstructedModel
from armloop.regression.moments import added
from armloop.util.arrays import Array, Mask

#: Which held-out blocks judge: all of them, those that choose the library, or those that choose nothing at all.
Part = Literal["all", "selection", "test"]
SELECTION: Part = "selection"

#: Where errors are summed apart.
PLACES = ("reversals", "creeping")
#: Moving samples that make a block's error one.
_FEWEST = 20


@dataclass(frozen=True, eq=False)
class Tally:
    """Sums over held-out samples; they add over chunks.

    Attributes:
        sums: per working condition (0 where samples are not sorted), (2, 3, n): of samples at rest and of
            moving ones, the squared errors, the squared torques and the number.
        blocks: (B, 2, n) of every block: the squared errors of samples that slide, and their number; empty where
            samples are no time series.
        samples: number of held-out samples.
        sliding: per working condition, (3, n): the same as ``sums`` of moving samples in which a joint is not slower than
            it slid where the model was fitted, nor near an end of its run. What friction is there the model cannot know, nor
            what a stop that ends a log asks of the drives; nor is a run judged by it.
        places: (2, n) of samples where a joint turns round (``reversals``, :mod:`armloop.data.reversals`), and where it
            creeps (``creeping``, :mod:`armloop.data.creep`): the squared errors, and their number; zeros where samples are
            no time series.
    """

    sums: dict[int, Array]
    blocks: Array
    samples: int
    places: dict[str, Array]
    sliding: dict[int, Array]

    def __add__(self, other: Tally) -> Tally:
        blocks, samples = np.concatenate([self.blocks, other.blocks]), self.samples + other.samples
        places, sliding = added(self.places, other.places), added(self.sliding, other.sliding)
        return Tally(added(self.sums, other.sums), blocks, samples, places, sliding)

    @staticmethod
    def of(
        chunk: Chunk,
        model: ReconstructedModel,
        sorter: Sorter | None,
        part: Part = "all",
        margin: float = 0.0,
        seconds: float | None = None,
    ) -> Tally:
        """Sums of one chunk, of all runs as they are: prediction and filter need every sample.

        Args:
            part: which of the held-out blocks judge.
            margin: seconds from a block that was fitted, or that chose, within which samples do not judge.
            seconds: length of the pieces that ``blocks`` are told apart by; the held-out blocks' own by default.
        """
        samples, held = chunk.samples, chunk.judging(part, margin)
        every = residual(model, samples) ** 2
        squares, moving = every[held], samples.moving[held]
        slid = moving & ~(too_slow(model, samples) | samples.at_an_end[:, None])[held]
        labels = np.zeros(len(held), dtype=int) if sorter is None else sorter(samples)
        sums, sliding = {}, {}
        for label in np.unique(labels[held]):
            rows = labels[held] == label
            given = squares[rows], samples.tau[held][rows]
            sums[int(label)] = error_sums(*given, moving[rows])
            sliding[int(label)] = error_sums(*given, slid[rows])[1]
        n = squares.shape[1]
        blocks, places = np.zeros((0, 2, n)), dict.fromkeys(PLACES, np.zeros((2, n)))
        if samples.cutoff_hz > 0 and held.any():
            pieces = (
                chunk.blocks if seconds is None else block_numbers(samples.motion, seconds, samples.spans)
            )
            keys = np.column_stack([chunk.blocks[held], pieces[held]])
            index = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
            blocks = np.zeros((int(index.max()) + 1, 2, n))
            np.add.at(blocks, index, np.stack([squares * slid, slid.astype(float)], axis=1))
            for key, there in _places(samples, model).items():
                counted = there & held[:, None]
                places[key] = np.array([(every * counted).sum(axis=0), counted.sum(axis=0)])
        return Tally(sums, blocks, int(held.sum()), places, sliding)

    @staticmethod
    def fitted(chunk: Chunk, model: ReconstructedModel, sorter: Sorter | None, seconds: float) -> Tally:
        """Sums of one chunk over all its samples, those that the model was fitted to included."""
        every = replace(chunk, held_out=np.ones_like(chunk.held_out))
        return Tally.of(every, model, sorter, seconds=seconds)

    def score(self) -> Score:
        """Score of all held-out samples; where there are none, errors of nothing."""
        nothing = np.zeros((2, 3, self.blocks.shape[2]))
        return score_of_sums(sum(self.sums.values(), nothing), self.samples)

    def baseline(self) -> dict[str, Any]:
        """What the model leaves, per joint: of the condition that it explains worst.

        A later run is one of motion; easy data (creeping, steady) must not make the model look better than
        it is on those.
        """
        per_condition = [errors_of(sums)["rmse"] for sums in self.sliding.values()]
        rmse = [
            max((x for x in joint if x is not None), default=None)
            for joint in zip(*per_condition, strict=True)
        ]
        rms = self.score().rms
        return {
            "rmse": rmse,
            "nrmse": ratios(rmse, rms),
            "rms": rms,
            **self.yardsticks(),
            "samples": self.samples,
        }

    def yardsticks(self) -> dict[str, list[float | None]]:
        """RMSE per joint that one block in ten exceeds (``worst``), and at the places that are apart."""
        sums = self.places.items()
        return {
            "worst": self.worst(),
            **{key: root_mean(*x) for key, x in sums},
        }

    def relative_blocks(self) -> Array:
        """(B,) mean square of each block's error relative to the torque, mean over the joints that move in it.

        NaN where none does.
        """
        scale = np.array([x if x else np.nan for x in self.score().rms]) ** 2
        errors, counts = self.blocks[:, 0], self.blocks[:, 1]
        relative = np.where(counts >= _FEWEST, errors / np.maximum(counts, _FEWEST), np.nan) / scale
        known = np.isfinite(relative)
        sums = np.where(known, relative, 0.0).sum(axis=1)
        return np.where(known.any(axis=1), sums / np.maximum(known.sum(axis=1), 1), np.nan)

    def worst(self) -> list[float | None]:
        """RMSE per joint that one block in ten exceeds: a run may consist of such motion."""
        found: list[float | None] = []
        for errors, counts in zip(self.blocks[:, 0].T, self.blocks[:, 1].T, strict=True):
            enough = counts >= _FEWEST
            many = int(enough.sum()) >= 10
            mean = errors[enough] / counts[enough]
            found.append(float(np.sqrt(np.quantile(mean, 0.9))) if many else None)
        return found


def _places(samples: Samples, model: ReconstructedModel) -> dict[str, Mask]:
    """(N, n) samples where a joint turns round, and where it creeps."""
    turns, ranges = passing(samples), model.history.get("range")
    speeds = np.zeros(samples.motion.joints) if ranges is None else np.asarray(ranges[1])
    places = at_reversals(samples, turns, samples.moving | turns), creeping(samples, speeds)
    return dict(zip(PLACES, places, strict=True))


def at_least(baseline: dict[str, Any], fitted: Tally) -> dict[str, Any]:
    """A baseline, joint by joint no better than what the model leaves of all its data.

    A model errs no less on samples that it was not fitted to, unless these are few and miss the rarer motion: where some
    joint turns round, say.

    Args:
        baseline: of held-out samples, with ``worst`` and what stands beside it.
        fitted: of the model, over all samples.
    """
    pair = [baseline, fitted.baseline()]
    places = [key for key in PLACES if key in baseline]  # none, of samples that are no time series
    more = {key: list(baseline[key]) for key in ("rmse", "rms", "nrmse", "worst", *places)}
    for j in range(len(more["rmse"])):
        own = max(pair, key=lambda one: one["rmse"][j] or 0.0)
        for key in ("rmse", "rms", "nrmse"):
            more[key][j] = own[key][j]
        for key in ("worst", *places):
            more[key][j] = max((one[key][j] for one in pair if one[key][j] is not None), default=None)
    return {**baseline, **more}
