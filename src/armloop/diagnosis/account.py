"""Joint hypothesis on a run, an account of it: its events, the effects found beside them, what no listed effect explains.

Accounts of one run are compared by what each leaves on held-out data, and by their posterior odds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armloop.data.motion import Motion
from armloop.diagnosis.contacts import Contact, find_contacts, without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import fit
from armloop.diagnosis.judgement import (
    CHANCE,
    MOST,
    MOSTLY,
    NEARLY_ALL,
    SIGNIFICANCE,
    gain,
    lead,
    much_is_left,
)
from armloop.diagnosis.outcomes import Outcome, without_effects_at
from armloop.diagnosis.score import Score
from armloop.diagnosis.search import search
from armloop.diagnosis.trials import Hypotheses, Known
from armloop.diagnosis.unlisted import Unlisted, find_law, further_laws
from armloop.laws.effects import Effect
from armloop.laws.effects.base import number
from armloop.laws.effects.found import RANGE
from armloop.laws.effects.time_delay import TimeDelay
from armloop.util.arrays import TINY, Array, Mask
from armloop.util.progress import Progress

#: What may have been recorded of a rest is left out for so many times the delay found: it may be longer than it looks.
_AHEAD = 4.0


@dataclass(frozen=True, eq=False)
class Account:
    """Joint hypothesis on a run: all that happened in it.

    Attributes:
        whole: the run; joints rest as long as their rest is recorded, where that is late.
        contacts: events, kept out of the search.
        evidence: the run without them.
        outcome: effects found.
        unlisted: the largest real residual that they leave, if there is one.
        further: laws of what is left of other joints beside it.
    """

    whole: Evidence
    contacts: list[Contact]
    evidence: Evidence
    outcome: Outcome
    unlisted: Unlisted | None
    further: Sequence[Unlisted] = ()

    @property
    def laws(self) -> list[Unlisted]:
        """Residuals that no listed effect explains, the largest first."""
        return [] if self.unlisted is None else [self.unlisted, *self.further]

    @staticmethod
    def of(
        whole: Evidence, contacts: list[Contact], progress: Progress, panel: Hypotheses | None = None
    ) -> Account:
        """Search a run in which these contacts are taken for granted."""
        evidence = without(whole, contacts)
        outcome = search(evidence, progress, panel)
        given, reach = whole, 0.0
        # Torques of joints at rest, recorded among those of joints that slide, make a delay look shorter than it is.
        while given.unknown is None and abs(_delay(outcome)) > abs(reach):
            reach = _AHEAD * _delay(outcome)
            progress("what was recorded late of joints at rest is left out, and the search made anew")
            whole = _resting_late(given, reach)
            evidence = without(whole, contacts)
            outcome = search(evidence, progress, panel)
        unlisted, kept = find_law(evidence, outcome, progress)
        further: Sequence[Unlisted] = ()
        if unlisted is not None:
            further, kept = further_laws(evidence, kept, unlisted, progress)
        account = Account(whole, contacts, evidence, kept, unlisted, further)
        return account._or_listed(outcome, progress, panel)

    def _or_listed(self, first: Outcome, progress: Progress, panel: Hypotheses | None) -> Account:
        """This, or the account by listed effects alone that a search finds without the one that it began with.

        One effect may lie between two that are there, and a forward search that took it cannot reach them. It is asked
        where a law took the place of some of what was found, or was put beside it: then others must leave no more; and
        where what was found leaves a multiple of the baseline: then they must leave far less of that. They are one more
        than what is there, at most: two in the place of one.

        Args:
            first: what the search found.
        """
        evidence, left = self.evidence, self.outcome.after.score
        # of a law its joint, else the one of which most is left, in baselines
        most = int(np.argmax(left.energy / np.maximum(left.rows, 1)))
        j = most if self.unlisted is None else self.unlisted.joint - 1
        elsewhere = without_effects_at(evidence, first, j).found
        there = [f.effect for f in first.found if f not in elsewhere]
        if not there or (self.unlisted is None and not much_is_left(left)[j]):
            return self
        progress(f"joint {j + 1}: whether other listed effects do better than {there[0].label()}")
        mine = self.score(evidence.rows)

        def does_better(others: Score) -> bool:
            if self.unlisted is not None:
                return lead(others, mine) <= CHANCE
            least = MOSTLY * float(mine.excess.sum())
            return gain(mine, others) >= least and lead(mine, others) > SIGNIFICANCE

        instead = len(first.found) + len(self.laws) + 1
        barred = [there[0].place]
        again = search(evidence, progress, panel, barred=barred, most=instead, worth=does_better)
        if not again.found:
            return self
        law, outcome = find_law(evidence, again, progress)
        other = replace(self, outcome=outcome, unlisted=None, further=())
        return other if law is None and does_better(other.score(evidence.rows)) else self

    def remaining(self) -> Array:
        """(N, n) residual of the model with effects and law, N·m (N); the law is tried beyond its range, too."""
        added = self.outcome.added()
        for each in self.laws:
            for law in each.added():
                everywhere = {key: e for key, e in law.parameters.items() if key not in RANGE}
                added.append(replace(law, parameters=everywhere))
        model = self.whole.model.with_effects(added)
        return self.whole.left_by(model)

    def without_effect(self, outcome: Outcome) -> Account:
        """The account of an outcome with fewer effects, and of the events those that are one without them, too."""
        fewer = replace(self, outcome=outcome)
        if not self.contacts:
            return fewer
        known = np.logical_or.reduce([contact.rows for contact in self.contacts])
        again = find_contacts(self.whole, fewer.remaining(), outcome.added())
        return replace(fewer, contacts=[contact for contact in again if (contact.rows & known).any()])

    def left(self, residual: Array, among: Mask | None = None) -> float:
        """Squared error, weighted, of the whole run: held-out, and what the events leave of their own samples.

        Samples that nothing was fitted to, and that are no event's, count with the residual.

        Args:
            among: (N, n) samples to count; all by default.
        """
        evidence, rows = self.evidence, self.whole.rows if among is None else self.whole.rows & among
        total = float((self._held_out()[rows[evidence.rows]] ** 2).sum())
        weighted = (residual / evidence.scale) ** 2
        others = rows & ~evidence.rows
        for contact in self.contacts:
            mine = rows & contact.rows[:, None]
            total += (1 - contact.share) * float(weighted[mine].sum())
            others &= ~mine
        return total + float(weighted[others].sum())

    def everywhere(self, residual: Array, rows: Mask) -> Score:
        """What judges all that is stated on some rows (N, n) that count, those of events among them.

        Args:
            residual: (N, n) what effects and law leave, N·m (N); of an event, what it explains is taken off.
        """
        left = (residual / self.evidence.scale) ** 2
        for contact in self.contacts:
            left[contact.rows] *= 1 - contact.share
        left[self.evidence.rows] = self._held_out() ** 2
        samples, joint = np.nonzero(rows)
        return Score.of(0, np.sqrt(left[rows]), joint, self.evidence.blocks[samples], rows.shape[1])

    def _held_out(self) -> Array:
        """(R,) what effects and law leave of every row, weighted."""
        held_out = self.outcome.after.held_out.copy()
        for law in self.laws:
            held_out[self.outcome.after.stacked.joint == law.joint - 1] = law.left
        return held_out

    def score(self, rows: Mask) -> Score:
        """What judges effects and law on some (N, n) of the rows that count."""
        stacked, some = self.outcome.after.stacked, rows[self.evidence.rows]
        joint, block = stacked.joint[some], stacked.block[some]
        return Score.of(0, self._held_out()[some], joint, block, stacked.joints)

    def explains(self, contacts: list[Contact], residual: Array) -> float:
        """The part of a residual (N, n), N·m (N), in the bursts of contacts that is not left by effects and law."""
        evidence, held_out = self.evidence, self._held_out()
        bursts = np.logical_or.reduce([contact.rows for contact in contacts])
        before = (residual / evidence.scale)[evidence.rows & bursts[:, None]]
        after = held_out[bursts[evidence.stacking[0]]]
        return 1 - float((after**2).sum()) / max(float((before**2).sum()), TINY)

    def foretells(self, evidence: Evidence, contacts: list[Contact], residual: Array) -> bool:
        """Whether effects predict, fitted to a run without these events, most of what each of them explains there.

        A push has nothing to do with what the run is like before and after it; a law that shows most at times has. What is
        fitted anew are coefficients; nonlinear parameters stay as they were, and say nothing of a size.

        Args:
            evidence: the run without the events.
            residual: (N, n) what the events explain a part of, N·m (N).
        """
        after, whole = self.outcome.after, self.whole
        if not after.effects:
            return False
        outside = fit(evidence, evidence.residual([]), after.effects, after.shapes)
        left = whole.left_by(whole.model.with_effects(outside.added()))
        for contact in contacts:
            mine = whole.rows & contact.rows[:, None]
            before, now = (float(((x / whole.scale)[mine] ** 2).sum()) for x in (residual, left))
            if before - now < MOSTLY * contact.share * before:
                return False
        return True


def laws_instead(
    whole: Evidence, contacts: list[Contact], panel: Hypotheses, progress: Progress
) -> list[Effect]:
    """Listed laws each of which leaves no more of a run, on blocks that it was not fitted on, than all of its events do."""
    if not contacts or not whole.rows.any():
        return []
    evidence = without(whole, contacts)
    nothing = fit(evidence, evidence.residual([]), [], [])
    account = Account(whole, contacts, evidence, Outcome([], nothing, nothing), None)
    least = account.left(whole.residual([]))
    return [trial.effect for trial in panel.tried(Known.of(whole), progress) if trial.score.error <= least]


def slid_since(motion: Motion, moving: Mask, seconds: float) -> Mask:
    """(N, n) samples in which a joint slides, and has slid for so many seconds; negative: will for so many more.

    A joint's torque while it rests is not determined by its motion; a delay of up to so many seconds brings it into samples
    that follow. Before a run it was as at its beginning.
    """
    way = -1 if seconds < 0 else 1
    slid = np.zeros_like(moving)
    for run in motion.runs():
        time, mine = way * motion.time[run][::way], moving[run][::way]
        begins = mine & ~np.vstack([mine[:1], mine[:-1]])
        since = np.maximum.accumulate(np.where(begins, time[:, None], -np.inf), axis=0)
        slid[run] = (mine & (time[:, None] - abs(seconds) >= since))[::way]
    return slid


def _resting_late(evidence: Evidence, seconds: float) -> Evidence:
    """The run in which a joint rests for as long as its rest is recorded, too, and its torque there says nothing."""
    samples = evidence.samples
    slid = slid_since(samples.motion, samples.moving, seconds)
    return replace(evidence, samples=replace(samples, moving=slid), rows=evidence.rows & slid, unknown=~slid)


def _delay(outcome: Outcome) -> float:
    """Seconds by which the torque of a joint is recorded late, at most: with all others and by itself; zero if none is."""
    late = {
        a.effect.joint: number(a.parameters["seconds"].value)
        for a in outcome.added()
        if isinstance(a.effect, TimeDelay)
    }
    of_all = late.pop(None, 0.0)
    return max((of_all + own for own in [0.0, *late.values()]), key=abs)


def best_account(
    whole: Evidence, contacts: list[Contact], progress: Progress, panel: Hypotheses | None = None
) -> Account:
    """The account with contacts where there are any, unless effects or a law explain those bursts as well.

    Args:
        contacts: what looks like contacts before anything else is known.
        panel: who tries the hypotheses; in this process by default.
    """
    account = plain = Account.of(whole, contacts, progress, panel)
    whole = account.whole
    # What effects and law leave shows events that they covered, and takes back those that they explain.
    residual = account.remaining()
    again = find_contacts(whole, residual, account.outcome.added())
    looked = replace(account, contacts=again)
    if (without(whole, again).rows == without(whole, contacts).rows).all():
        account = looked  # in the same samples, without what the effects do there
    else:
        account = Account.of(whole, again, progress, panel)
        # Beside what only looked like an event, a search may go another way than without it.
        if not again and looked.left(residual) < account.left(residual):
            laws = [law.over(whole) for law in looked.laws]
            return replace(looked, unlisted=laws[0], further=laws[1:]) if laws else looked
    if not account.contacts:
        return account
    if contacts:
        plain = Account.of(whole, [], progress, panel)
    # nearly all of the bursts, or as much as the contacts explain
    enough = min(NEARLY_ALL, max(contact.share for contact in account.contacts))
    # A law of which these are the bursts; a residual without a law explains none of them.
    law = plain.unlisted if plain.unlisted is not None and plain.unlisted.parameters else None
    same = law is not None and account.unlisted is not None and account.unlisted.joint == law.joint
    bare, plain_left, left = (
        float(((whole.residual([]) / whole.scale)[whole.rows] ** 2).sum()),
        *(each.left(residual) for each in (plain, account)),
    )
    alike = bare - plain_left >= MOST * (bare - left)
    explained = alike and (
        plain.explains(account.contacts, residual) >= enough
        or plain.foretells(account.evidence, account.contacts, residual)
    )
    if same or explained or plain_left <= left:
        progress("what looked like contacts is explained without them")
        return plain
    return account
