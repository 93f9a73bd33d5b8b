"""From a model and a measured run to a verdict, the effects found, and the augmented model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armloop.diagnosis.account import best_account
from armloop.diagnosis.alternatives import why_alike
from armloop.diagnosis.contacts import Contact, find_contacts, known_contacts, without
from armloop.diagnosis.evidence import FEWEST_BLOCKS, Evidence
from armloop.diagnosis.fit import Fit, fit
from armloop.diagnosis.remedies import remedy
from armloop.diagnosis.reversals import AtReversals, judge_reversals
from armloop.diagnosis.search import Found, Outcome
from armloop.diagnosis.unlisted import Unlisted
from armloop.diagnosis.whereabouts import whereabouts
from armloop.effects import hypotheses
from armloop.errors import InputError
from armloop.log import MotionLog, require_different
from armloop.model import ReconstructedModel
from armloop.motion import Samples
from armloop.progress import Progress, silent
from armloop.signals import condition

Array = NDArray[np.float64]

SCHEMA = "armloop/diagnosis/1"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict on a run.

    Attributes:
        verdict: ``no_effect``, ``effects_found`` or ``unlisted_effect``.
        outcome: the search's result.
        model: the model with the effects found.
        unlisted: the law of a residual that no listed effect explains, if there is such a residual.
        contacts: events of the run, found before the search and kept out of it.
        evidence: the run as it was judged; reversals are among its rows only if something was found there.
        reversals: what was found at reversals, if anything.
    """

    verdict: str
    outcome: Outcome
    model: ReconstructedModel
    unlisted: Unlisted | None
    evidence: Evidence
    contacts: list[Contact]
    reversals: AtReversals | None = None

    @property
    def samples(self) -> Samples:
        """The run, conditioned."""
        return self.evidence.samples

    @property
    def judged(self) -> bool:
        """Whether the run, contacts apart, holds enough motion to look for anything else in it."""
        return not _too_still(self.evidence)

    def errors(self) -> dict[str, Any]:
        """RMSE per joint of held-out moving samples, before and after, beside the baseline's; NaN for joints at rest."""
        scale = self.evidence.scale
        tau = np.sqrt(_by_joint(self.outcome.before, self._torque() ** 2))
        before, after = (
            np.sqrt(_by_joint(f, f.held_out**2)) * scale for f in (self.outcome.before, self.outcome.after)
        )
        return {
            "metric": "rmse",
            "held_out": True,
            "unit": self.model.arm.torque_units,
            "before": before.tolist(),
            "after": after.tolist(),
            "noise_floor": scale.tolist(),
            "nrmse": {"before": _ratio(before, tau).tolist(), "after": _ratio(after, tau).tolist()},
            **self._at_reversals(),
        }

    def _at_reversals(self) -> dict[str, Any]:
        turned = self.reversals
        if turned is None:
            return {}
        return {"reversals": {"before": turned.before.tolist(), "after": turned.after.tolist()}}

    def _only_at_reversals(self, found: Found) -> bool:
        return self.reversals is not None and found in self.reversals.found

    def _torque(self) -> Array:
        stacked = self.outcome.before.stacked
        order = np.argwhere(self.evidence.rows)
        assert len(order) == len(stacked.y)
        return np.asarray(self.samples.tau[order[:, 0], order[:, 1]])

    def to_dict(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        effects: list[dict[str, Any]] = []
        for found, added in zip(self.outcome.found, self.outcome.added(), strict=True):
            effects.append(
                {
                    **added.to_dict(),
                    "share": found.share,
                    **({"condition": "reversals"} if self._only_at_reversals(found) else {}),
                    "words": added.effect.sentence(added.parameters),
                    "sensor": added.effect.sensor,
                    **({"remedy": remedy(added)} if added.effect.sensor else {}),
                    "alternatives": [
                        {
                            "effect": rival.name,
                            "joint": rival.joint,
                            **({"other_joint": rival.other_joint} if rival.pair_wise else {}),
                            "share": share,
                            "why": why_alike(added.effect, rival),
                        }
                        for rival, share in found.rivals
                    ],
                }
            )
        effects.sort(key=lambda item: -item["share"])
        effects += [
            {
                **contact.added.to_dict(),
                "share": contact.share,
                "words": contact.added.effect.sentence(contact.added.parameters),
                "rmse": {"before": contact.before.tolist(), "after": contact.after.tolist()},
                "alternatives": [],
            }
            for contact in self.contacts
        ]
        if self.unlisted is not None:
            where = whereabouts(self.evidence, self.outcome.after, self.unlisted.joint - 1)
            effects.append({**self.unlisted.to_dict(), "where": where.to_dict()})
        return {"schema": SCHEMA, "verdict": self.verdict, "effects": effects, "error": _null(self.errors())}


def _by_joint(fit: Fit, values: Array) -> Array:
    """(n,) mean of row values over each joint; NaN where a joint has no rows."""
    joints, n = fit.stacked.joint, fit.stacked.joints
    counts = np.bincount(joints, minlength=n)
    return _ratio(np.bincount(joints, weights=values, minlength=n), counts)


def _ratio(x: NDArray[Any], y: NDArray[Any]) -> Array:
    """x / y, NaN where y is zero."""
    return np.divide(x, y, out=np.full(len(x), np.nan), where=y > 0)


def _null(value: Any) -> Any:
    """The same for JSON, which has null in place of NaN."""
    if isinstance(value, dict):
        return {key: _null(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_null(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def diagnose(model: ReconstructedModel, logs: Sequence[MotionLog], progress: Progress = silent) -> Diagnosis:
    """Find what the model lacks on a measured run.

    Args:
        logs: one or more runs of the same arm under the same circumstances, torque in the model's unit.

    Raises:
        InputError: the logs do not fit the model, or hold too little motion to judge.
    """
    if model.recorded["unit"] == "A" and model.recorded["drive_gains"] is None:
        raise InputError(
            "the model predicts motor currents (A), in which no effect has its physical size; "
            "reconstruct it with --drive-gains K1,..,KN (N·m/A)"
        )
    for log in logs:
        if log.joints != model.arm.n:
            raise InputError(
                f"{log.name}: {log.joints} joints, but the model's arm {model.arm.name} has {model.arm.n}"
            )
    require_different(logs)
    progress("conditioning the run like the model's training logs")
    samples = condition(logs, model.conditioning)
    for j in range(model.arm.n):
        if not samples.tau[:, j].any():
            raise InputError(
                f"{logs[0].name}: tau{j + 1} is zero throughout; give a log that holds the joint's torque"
            )
    whole = Evidence.of(model, samples, hypotheses(model.arm))
    contacts = find_contacts(whole, whole.residual([]))
    evidence = without(whole, contacts)
    if _too_still(evidence):
        if not contacts and not known_contacts(whole).any():
            raise InputError(f"{logs[0].name}: {_too_still(evidence)}")
        left = evidence.residual([])
        nothing = fit(evidence, left, [], [])
        added = [contact.added for contact in contacts]
        verdict = "effects_found" if contacts else "no_effect"
        return Diagnosis(
            verdict,
            Outcome([], nothing, nothing, left),
            model.with_effects(added),
            None,
            evidence,
            contacts,
        )
    blocks = len(np.unique(evidence.blocks))
    progress(f"searching {len(hypotheses(model.arm))} hypotheses on {blocks} blocks")
    account = best_account(whole, contacts, not _too_still(whole), progress)
    contacts, evidence = account.contacts, account.evidence
    outcome, unlisted = account.outcome, account.unlisted
    kept = without(whole.only(np.ones_like(whole.rows)), contacts).rows
    if unlisted is not None:
        kept[:, unlisted.joint - 1] = False
    turned = judge_reversals(evidence, outcome, kept, progress)
    if turned is not None:
        outcome, evidence = turned.outcome, turned.evidence
    found = bool(outcome.found or contacts)
    verdict = "effects_found" if found else "unlisted_effect" if unlisted is not None else "no_effect"
    added = [*outcome.added(), *(contact.added for contact in contacts)]
    return Diagnosis(verdict, outcome, model.with_effects(added), unlisted, evidence, contacts, turned)


def _too_still(evidence: Evidence) -> str:
    """What keeps the run from being judged, empty if nothing does."""
    # A joint that is pushed about within its friction has not moved.
    ranges = evidence.model.history.get("range")
    slow = 0.01 * np.asarray(ranges[1]) if ranges else np.full(evidence.rows.shape[1], 1e-3)
    moving = evidence.rows & (np.abs(evidence.samples.motion.v) > slow)
    still = [j + 1 for j, rows in enumerate(moving.T) if rows.sum() < 20]
    blocks = len(np.unique(evidence.blocks))
    if len(still) < evidence.rows.shape[1] and blocks >= FEWEST_BLOCKS:
        return ""
    return (
        f"too little motion to judge ({blocks} blocks of a second or more, joints at rest: {still}); log at least "
        f"{FEWEST_BLOCKS + 1} s in which the joints move"
    )
