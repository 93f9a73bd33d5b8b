"""The answer of a diagnosis: its verdict, what was found with how surely, and the errors before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from armloop.data.motion import Samples
from armloop.diagnosis import probability
from armloop.diagnosis.contacts import Contact
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.outcomes import Found, Outcome, Strength
from armloop.diagnosis.reasons import Standing, spaced, too_still, unlike
from armloop.diagnosis.reversals import AtReversals
from armloop.diagnosis.score import mean_by_joint, ratio
from armloop.diagnosis.unlisted import Unlisted
from armloop.diagnosis.whereabouts import whereabouts
from armloop.laws.effects import Effect
from armloop.laws.effects.base import entry
from armloop.laws.effects.listed import EFFECTS, listed
from armloop.model import ReconstructedModel
from armloop.util.arrays import Array, Mask
from armloop.util.finite import finite

SCHEMA = "armloop/diagnosis/2"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict on a run.

    Attributes:
        verdict: ``no_effect``, ``effects_found``, ``unlisted_effect`` or ``cannot_tell``.
        outcome: the search's result.
        model: the model with the effects found.
        unlisted: the law of the largest residual that no listed effect explains, if there is such a residual.
        contacts: events of the run, found before the search and kept out of it.
        evidence: the run as it was judged; reversals are among its rows only if something was found there.
        sliding: (N, n) samples of the evidence that are no reversals.
        reversals: what was found at reversals, if anything.
        strengths: of each effect found.
        adopted: whether the model has the unlisted laws.
        standing: how far the run can be judged: what a reader must know beside the verdict.
        zeros: (L, n) encoder zeros of the logs, rad (m), that were taken off before they were judged.
        further: laws of what is left of other joints beside the unlisted one.
        logs: names of the logs that this is said of.
        apart: verdicts on logs in which the arm was not the same.
    """

    verdict: str
    outcome: Outcome
    model: ReconstructedModel
    unlisted: Unlisted | None
    evidence: Evidence
    contacts: list[Contact]
    sliding: Mask
    reversals: AtReversals | None = None
    standing: Standing = field(default_factory=lambda: Standing([], [], False))
    strengths: list[Strength] = field(default_factory=list)
    adopted: bool = False
    zeros: Array = field(default_factory=lambda: np.zeros((0, 0)))
    further: Sequence[Unlisted] = ()
    logs: tuple[str, ...] = ()
    apart: tuple[Diagnosis, ...] = ()

    @property
    def laws(self) -> list[Unlisted]:
        """Residuals that no listed effect explains, with their laws, the largest first."""
        return [] if self.unlisted is None else [self.unlisted, *self.further]

    def adopt(self) -> Diagnosis:
        """The same with the unlisted laws, where any were found, in the model: its feedforward supplies them.

        A law acts where the run has been and fades outside of it (:class:`armloop.laws.effects.FoundLaw`).
        """
        added = [] if self.adopted else [each for law in self.laws for each in law.added()]
        return replace(self, model=self.model.with_effects(added), adopted=True) if added else self

    def beside(self, others: Sequence[Diagnosis]) -> Diagnosis:
        """The same with the verdicts on logs in which the arm was not the same."""
        return replace(self, apart=(*others, *self.apart))

    @property
    def reasons(self) -> list[str]:
        """What a reader must know before relying on the verdict."""
        others = [(each.logs, each.labels or [each.verdict]) for each in self.apart]
        return [*([unlike(self.logs, others)] if others else []), *self.standing.reasons]

    @property
    def named(self) -> list[tuple[str, int | None]]:
        """Name and joint of everything found, events last."""
        effects = [found.effect for found in self.outcome.found]
        effects += [contact.added.effect for contact in self.contacts]
        return [(effect.name, effect.joint) for effect in effects]

    @property
    def labels(self) -> list[str]:
        """What was found, in words."""
        events = len(self.contacts)
        return [
            *(found.effect.label() for found in self.outcome.found),
            *([f"{events} event{'s' * (events > 1)}"] if events else []),
            *(f"a law of joint {law.joint} that is not listed" for law in self.laws),
        ]

    @property
    def samples(self) -> Samples:
        """The run, conditioned."""
        return self.evidence.samples

    @property
    def judged(self) -> bool:
        """Whether the run, contacts apart, holds enough motion to look for anything else in it."""
        return not too_still(self.evidence)

    def errors(self) -> dict[str, Any]:
        """RMSE per joint of held-out sliding samples, before and after, beside the baseline's; NaN for joints at rest.

        What a joint does where it turns round has numbers of its own, for the baseline knows nothing of it.
        """
        scale, slides = self.evidence.scale, self.sliding[self.evidence.rows]
        joint, n = self.outcome.before.stacked.joint[slides], len(scale)
        tau, before, after = (
            np.sqrt(mean_by_joint(joint, n, x[slides] ** 2))
            for x in (
                self.samples.tau[self.evidence.rows],
                self.outcome.before.held_out * scale[self.outcome.before.stacked.joint],
                self.outcome.after.held_out * scale[self.outcome.before.stacked.joint],
            )
        )
        for law in self.laws if self.adopted else []:
            after[law.joint - 1] = law.rmse_with_form
        turned = self.reversals
        at = {} if turned is None else {"before": turned.before.tolist(), "after": turned.after.tolist()}
        return {
            "metric": "rmse",
            "held_out": True,
            "unit": self.model.arm.torque_units,
            "before": before.tolist(),
            "after": after.tolist(),
            "noise_floor": scale.tolist(),
            "nrmse": {"before": ratio(before, tau).tolist(), "after": ratio(after, tau).tolist()},
            **({"reversals": at} if at else {}),
        }

    def _only_at_reversals(self, found: Found) -> bool:
        return self.reversals is not None and found in self.reversals.found

    def to_dict(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        effects: list[dict[str, Any]] = []
        every = zip(self.outcome.found, self.outcome.added(), self.strengths, strict=True)
        growths = self.outcome.growths()
        for found, added, strength in every:
            onset = added.effect.onset
            growth = None if found.shape.proportion is None else growths.get(found.effect.joint or 0)
            effects.append(
                {
                    **added.to_dict(),
                    **({} if onset is None else {onset.word: onset.to_dict()}),
                    "share": found.share,
                    "when": "event" if added.effect.event else "always" if found.always else "changed",
                    "probability": probability.of_effect(found.share, strength.times)
                    if listed(found.effect)
                    else None,
                    "strength": strength.to_dict(),
                    **({} if growth is None else {"growth": growth.to_dict()}),
                    **({"condition": "reversals"} if self._only_at_reversals(found) else {}),
                    "words": added.sentence(),
                    "sensor": added.effect.sensor,
                    **({"remedy": added.remedy()} if added.effect.sensor else {}),
                    "alternatives": _alternatives(added.effect, found.rivals),
                }
            )
        effects += [
            {
                **contact.added.to_dict(),
                "share": contact.share,
                "when": "event",
                "probability": probability.EVENT.probability,
                "words": contact.added.effect.sentence(contact.added.parameters),
                "rmse": {"before": contact.before.tolist(), "after": contact.after.tolist()},
                "alternatives": _alternatives(contact.added.effect, contact.rivals),
            }
            for contact in self.contacts
        ]
        for law in self.laws:
            where = whereabouts(self.evidence, self.outcome.after, law.joint - 1)
            entry = {
                "when": "changed",
                "probability": probability.UNLISTED.probability,
                "where": where.to_dict(),
                "adopted": self.adopted,
            }
            effects.append({**law.to_dict(), **entry})
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "reasons": self.reasons,
            "joints": self.standing.joints,
            **({"encoder_zeros": self.zeros.tolist()} if self.zeros.any() else {}),
            "logs": list(self.logs),
            **({"apart": [each.to_dict() for each in self.apart]} if self.apart else {}),
            "effects": effects,
            "error": finite(self.errors()),
        }


def _alternatives(effect: Effect, confounded: list[tuple[Effect, float]]) -> list[dict[str, Any]]:
    """Entries of what this motion cannot tell from an effect."""
    return [{**entry(*one.place), "share": share, "why": why_alike(effect, one)} for one, share in confounded]


def why_alike(found: Effect, rival: Effect) -> str:
    """Why two effects can look alike on one motion, and what would tell them apart: a sentence."""
    alike = f"on this motion {spaced(rival.label())} explains held-out data nearly as well as {spaced(found.label())}"
    if found.event and rival.event:
        return (
            f"{alike}; what was there for a time is over, and no further run tells them apart: only what is known of "
            "that time does, such as what touched the arm, and where"
        )
    if found.event or rival.event:
        lasting, over = (rival, found) if found.event else (found, rival)
        return (
            f"{alike}; a further run tells whether {spaced(lasting.label())} is still there, without "
            f"{spaced(over.label())}, which was an event of this run"
        )
    listed = _said(found, rival)
    if listed and (found.joint is None or rival.joint is None or found.joint == rival.joint):
        return listed
    return f"{alike}; a run over other postures and speeds may tell them apart: armloop diagnose --next-run designs one"


def _said(found: Effect, rival: Effect) -> str | None:
    """What either says of the other, or else of what that looks like."""
    own = found.alike.get(rival.name) or rival.alike.get(found.name)
    if own:
        return own
    stand_ins = [EFFECTS.get(effect.looks_like, type(effect)) for effect in (found, rival)]
    return stand_ins[0].alike.get(stand_ins[1].name) or stand_ins[1].alike.get(stand_ins[0].name)
