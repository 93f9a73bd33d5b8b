"""Significance of an event: what it stands out of, at other times of its run.

An event is judged by what is left beside it: by what a law would show at those times, too, and by what nothing accounts for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import MULTIPLE
from armloop.diagnosis.pushes import Contact
from armloop.diagnosis.recurrence import within
from armloop.laws.effects import Effect
from armloop.laws.effects.events import ends
from armloop.model import ReconstructedModel


def told(whole: Evidence, evidence: Evidence, contact: Contact, laws: Sequence[Effect]) -> bool:
    """Whether an event can be told from a law of the motion where a run is too short to search for one.

    A joint that shows it leaves a multiple of what it leaves at other times, when a law would show, too; or it does not
    slide at all. And no law of these joints explains the run as well.

    Args:
        whole: the run.
        evidence: the run without its events.
        laws: laws that leave no more of it than all events do.
    """
    if any(law.joint is None or contact.shown & set(law.indices) for law in laws):
        return False
    left, scale = (evidence.residual([]) / evidence.scale) ** 2, evidence.scale

    def stands_out(j: int) -> bool:
        rows = evidence.rows[:, j]
        if not whole.rows[:, j].any():
            return True
        usual = max(float(left[rows, j].mean()), 1.0) if rows.any() else np.inf
        return bool((contact.before[j] / scale[j]) ** 2 >= MULTIPLE**2 * usual)

    return any(stands_out(j) for j in contact.shown)


def drowned(evidence: Evidence, model: ReconstructedModel, contact: Contact) -> bool:
    """Whether an event removes no more than twice what is left, outside of all events, of some stretch that is as long.

    Of a residual that nothing accounts for the highest peaks look like events, and others are hardly lower.

    As long in samples that count: where the joint rests nothing is left to see, in a program with dwells of any stretch.
    Each joint counts by its part of what the event removes, as for effects that an unknown rest outweighs, and where less
    than twice the baseline is left it does not; noise that is more than that has peaks like any other rest.

    Args:
        evidence: the run without its events.
        model: that with the effects found.
    """
    motion, kept, rows = evidence.samples.motion, evidence.independent, evidence.rows
    left = (np.where(rows, evidence.left_by(model), 0.0)[kept] / evidence.scale) ** 2
    start, end = ends(contact.added.parameters)
    time = motion.time[kept]
    length = max(int((contact.rows[kept] & (time >= start) & (time <= end)).sum()), 1)
    removed = np.maximum(contact.before**2 - contact.after**2, 0.0) / evidence.scale**2
    rest = np.zeros(len(removed))
    for j in range(len(removed)):
        if left[:, j].sum() < MULTIPLE**2 * rows[:, j].sum():
            continue
        for run in motion.runs():
            mine = within(kept, run)
            sums = np.cumsum(np.append(0.0, left[mine, j][rows[kept, j][mine]]))
            most = float((sums[length:] - sums[:-length]).max(initial=0.0)) / length
            rest[j] = max(rest[j], most - 1.0)
    return bool(removed @ (removed - MULTIPLE * rest) < 0)
