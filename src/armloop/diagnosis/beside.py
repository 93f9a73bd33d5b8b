"""Conditional search: the account of a run given some effects, with the times at which they are there; all else is anew.

What comes and goes within a run is no hypothesis of the search, for when it does is found first. The search is made by a
model that has the effects, and then all are fitted together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from armloop.diagnosis.account import Account, best_account
from armloop.diagnosis.contacts import find_contacts, without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.judgement import gain, leaves_more, soaked
from armloop.diagnosis.outcomes import Found, Outcome, clear, pruned
from armloop.diagnosis.trials import Hypotheses, Known
from armloop.model import AddedEffect
from armloop.util.arrays import Mask
from armloop.util.progress import Progress


def known_part(whole: Evidence, unknown: Mask) -> Evidence:
    """The run without known events, and without samples (N, n) of which nothing is to be said."""
    return without(whole.only(whole.rows & ~unknown), [])


def known_by(whole: Evidence, added: list[AddedEffect]) -> Evidence:
    """The run as a model sees it that has some effects."""
    seen = Evidence.of(whole.model.with_effects(added), whole.samples, list(whole.asked))
    return replace(seen, whitening=whole.whitening)


def with_account(evidence: Evidence, given: Sequence[Found], account: Account) -> Known:
    """The given effects and what an account has found, fitted together."""
    after = account.outcome.after
    effects, shapes = [f.effect for f in given], [f.shape for f in given]
    return Known.of(evidence, [*effects, *after.effects], [*shapes, *after.shapes])


def account_beside(
    whole: Evidence, known: Known, unknown: Mask, progress: Progress, jobs: int | None, given: int = 1
) -> Account:
    """The account of a run by a model that has the given effects, so many, the first of what is known."""
    again = known_by(whole, known.fit.added()[:given])
    if again.unknown is not None:
        unknown = unknown | again.unknown
    again = replace(again, rows=again.rows & ~unknown, unknown=unknown)
    with Hypotheses(again, jobs) as panel:
        contacts = find_contacts(again, again.residual([]))
        return best_account(again, contacts, progress, panel)


def merged(whole: Evidence, given: Sequence[Found], other: Account) -> Account:
    """The account by the model as it is of one by a model that has the given effects: these are among those found.

    The share of the first is that which it removes by itself.
    """
    evidence, first = whole.only(other.evidence.rows), given[0]
    nothing, alone = (Known.of(evidence, *each).fit for each in ((), ([first.effect], [first.shape])))
    bare = nothing.score
    share = gain(bare, alone.score) / max(float(bare.excess.sum()), 1e-9)
    every = [replace(first, share=min(share, 1.0)), *given[1:], *other.outcome.found]
    together = Outcome(every, nothing, with_account(evidence, given, other).fit)
    run = replace(whole, rows=other.whole.rows, unknown=other.whole.unknown)
    return replace(other, whole=run, evidence=evidence, outcome=clear(evidence, pruned(evidence, together)))


def at_the_cost_of_others(account: Account, other: Account) -> bool:
    """Whether an account surely leaves more of some joints than another without its effect: that is but like what is there.

    Args:
        account: that without the effect.
        other: that with it.
    """
    common = account.evidence.rows & other.evidence.rows
    bare, plain = Known.of(other.whole.only(common)).fit.score, account.score(common)
    return leaves_more(other.score(common), plain, soaked(bare, plain))
