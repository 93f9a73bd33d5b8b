"""The rules by which a trial is fitted and judged, each on numbers small enough to see through."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import armloop.diagnosis.account as accounts
from armloop.diagnosis.evidence import FOLDS, Evidence, Stacked
from armloop.diagnosis.fit import Fit
from armloop.diagnosis.judgement import SIGNIFICANCE, is_worth, lead, lead_of
from armloop.laws.effects import Estimate, effect
from armloop.regression.embedded import solve
from armloop.regression.moments import Moments


def left(held_out: np.ndarray, block: np.ndarray, joint: np.ndarray | None = None) -> Fit:
    """A fit that leaves this, of one joint or those given (0-based), with blocks as given."""
    rows = len(held_out)
    joint = np.zeros(rows, dtype=np.intp) if joint is None else joint
    stacked = Stacked(np.zeros((rows, 0)), held_out, block, block % 2, joint, int(joint.max()) + 1)
    return Fit((), (), (), np.tile(held_out, (FOLDS, 1)), stacked)


def test_a_gain_that_lies_in_few_blocks_is_no_chance() -> None:
    """Friction that fades within the first sixth of a run, against the noise that stays."""
    rng = np.random.default_rng(1)
    block = np.repeat(np.arange(34), 60)
    noise = rng.normal(size=len(block))
    fades = 30.0 * np.exp(-block / 5.0)
    assert lead(left(noise + fades, block), left(noise, block)) > SIGNIFICANCE


def test_a_law_that_bites_in_one_block_of_many_is_no_chance() -> None:
    """What a drag leaves where the joint is fast once; elsewhere the two fits differ by chance."""
    rng = np.random.default_rng(3)
    block = np.repeat(np.arange(20), 60)
    before, after = rng.normal(size=(2, len(block)))
    before[block == 7] *= 9.0
    worse, better = left(before, block), left(after, block)
    spread = lead_of(worse.block_errors(), better.block_errors(), worse.block_rows())
    assert spread < SIGNIFICANCE < lead(worse, better)


@pytest.mark.parametrize(("sizes", "worth"), [((0.6, 0.6), True), ((0.3, 0.6), False), ((0.0, 1.2), True)])
def test_what_shows_a_little_on_every_joint_adds_up(sizes: tuple[float, float], worth: bool) -> None:
    """Of an energy that the worst tenth of the baseline has, 2 here: parts of it that both joints gain."""
    rng = np.random.default_rng(4)
    block, joint = np.tile(np.repeat(np.arange(40), 50), 2), np.repeat([0, 1], 2000)
    after = rng.normal(size=4000)
    after /= np.sqrt(np.mean(after.reshape(2, -1) ** 2, axis=1))[joint]
    before = after * np.sqrt(1 + 2.0 * np.array(sizes))[joint]
    evidence = cast(Evidence, SimpleNamespace(variation=np.array([2.0, 2.0])))
    assert is_worth(evidence, left(before, block, joint), left(after, block, joint)) == worth


@pytest.mark.parametrize(("by_effects", "kept"), [(50.0, 0), (150.0, 1)])
def test_an_event_gives_way_to_effects_that_leave_less_of_the_whole_run(
    by_effects: float, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fast for once, a joint's drag looks like a push there; the push leaves what the drag does elsewhere."""
    event = SimpleNamespace(share=0.9)

    def of(whole: object, contacts: list[object], progress: object) -> SimpleNamespace:
        return SimpleNamespace(
            contacts=contacts,
            evidence=SimpleNamespace(rows=np.zeros((4, 1), dtype=bool)),
            outcome=SimpleNamespace(added=list),
            unlisted=None,
            explains=lambda contacts, residual: 0.7,
            left=lambda residual: 100.0 if contacts else by_effects,
        )

    class Samples:
        tau = np.zeros((4, 1))
        motion = None

    model = SimpleNamespace(with_effects=lambda added: SimpleNamespace(predict=lambda motion: Samples.tau))
    whole: Any = SimpleNamespace(model=model, samples=Samples)
    monkeypatch.setattr(accounts.Account, "of", of)
    monkeypatch.setattr(accounts, "find_contacts", lambda whole, residual: [event])
    monkeypatch.setattr(accounts, "without", lambda whole, contacts: of(whole, contacts, None).evidence)
    monkeypatch.setattr(accounts, "smooth", lambda samples, tau: tau)
    contacts: Any = [event]
    account = accounts.best_account(whole, contacts, True, lambda text: None)
    assert len(account.contacts) == kept


def test_noise_has_no_lead() -> None:
    block = np.repeat(np.arange(34), 60)
    for seed in range(20):
        one, other = np.random.default_rng(seed).normal(size=(2, len(block)))
        assert lead(left(one, block), left(other, block)) < SIGNIFICANCE + 1


def test_a_column_of_rounding_errors_does_not_mislead_a_load() -> None:
    """The moment about a joint's own axis has no torque but what rounding leaves."""
    load = effect("payload", None)
    rng = np.random.default_rng(2)
    X = rng.normal(size=(500, 10))
    X[:, 2] *= 1e-17
    beta, _ = load.embed(np.array([0.5, 0.05, 0.0, 0.02, 0.0]))
    y = X @ beta + 0.01 * rng.normal(size=500)
    found = solve(Moments.of(X, y), [load], [10])[1][0]
    np.testing.assert_allclose(found[:2], [0.5, 0.05], atol=0.01)
    assert abs(found[2]) < 1.0


def test_a_width_beyond_what_was_tried_is_not_resolved() -> None:
    memory = effect("presliding_hysteresis", 1)
    for width, shown in ((1e-5, False), (1e-3, True), (1.0, False)):
        parameters = {"level": Estimate(1.0, 0.1, "N*m"), "width": Estimate(width, 0.0, "rad")}
        assert memory.resolved(parameters, [1e-4, 1e-2]) == shown
