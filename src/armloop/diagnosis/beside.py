"""Accounts of a run beside one effect that is given, with the times at which it is there: all else is searched anew.

What comes and goes within a run is no hypothesis of the search, for when it does is found first. The search is made by a
model that has the effect, and then both are fitted together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from armloop.diagnosis.account import Account, best_account
from armloop.diagnosis.contacts import find_contacts, without
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
from armloop.diagnosis.judgement import gain, leaves_more, soaked
from armloop.diagnosis.search import Found, Outcome, clear, pruned
from armloop.diagnosis.trials import Hypotheses, Known
from armloop.laws.effects import Effect
from armloop.model import AddedEffect
from armloop.util.arrays import Mask
from armloop.util.progress import Progress


def known_part(whole: Evidence, unknown: Mask) -> Evidence:
    """The run without known events, and without samples (N, n) of which nothing is to be said."""
    return without(whole.only(whole.rows & ~unknown), [])


def known_by(whole: Evidence, added: list[AddedEffect]) -> Evidence:
    """The run as a model sees it that has some effects."""
    return Evidence.of(whole.model.with_effects(added), whole.samples, list(whole.asked))


def with_account(evidence: Evidence, given: Effect, shape: Shape, account: Account) -> Known:
    """The given effect and what an account has found, fitted together."""
    after = account.outcome.after
    return Known.of(evidence, [given, *after.effects], [shape, *after.shapes])


def account_beside(
    whole: Evidence, known: Known, unknown: Mask, progress: Progress, jobs: int | None
) -> Account:
    """The account of a run by a model that has the given effect, the first of what is known."""
    again = known_by(whole, known.fit.added()[:1])
    if again.unknown is not None:
        unknown = unknown | again.unknown
    again = replace(again, rows=again.rows & ~unknown, unknown=unknown)
    with Hypotheses(again, jobs) as panel:
        contacts = find_contacts(again, again.residual([]))
        return best_account(again, contacts, progress, panel)


def merged(
    whole: Evidence,
    given: Effect,
    shape: Shape,
    other: Account,
    rivals: Sequence[tuple[Effect, float]] = (),
) -> Account:
    """The account by the model as it is of one by a model that has the given effect: that is among the effects found."""
    evidence = whole.only(other.evidence.rows)
    nothing, alone = (Known.of(evidence, *each).fit for each in ((), ([given], [shape])))
    bare = nothing.score
    share = gain(bare, alone.score) / max(float(bare.excess.sum()), 1e-9)
    every = [Found(given, shape, min(share, 1.0), list(rivals)), *other.outcome.found]
    together = Outcome(every, nothing, with_account(evidence, given, shape, other).fit)
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
