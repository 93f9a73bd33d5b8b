"""Effects that cannot be worth it are passed over before they are fitted: the answers are as if they had not been."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, run

from armloop.data.signals import preprocess
from armloop.diagnosis import trials
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import REFINEMENTS, Shape
from armloop.diagnosis.posterior import ALTERNATIVE, log_prior, told
from armloop.diagnosis.search import search
from armloop.diagnosis.trials import PROMISING, Known
from armloop.laws.effects import effect, hypotheses
from armloop.util.progress import silent


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    """Joint 2 rubs more, and has a law of no list."""
    log = run(1, 30.0)
    tau = log.tau.copy()
    tau[:, 1] += 0.3 * log.v[:, 1] + 0.4 * np.cos(2 * log.q[:, 0]) * log.v[:, 1]
    model = model_with_baseline()
    samples = preprocess([replace(log, tau=tau)], model.conditioning)
    return Evidence.of(model, samples, hypotheses(model.arm))


@pytest.mark.parametrize("there", [(), ("viscous_friction",)])
def test_nothing_explains_more_than_its_bound(evidence: Evidence, there: tuple[str, ...]) -> None:
    known = Known.of(evidence, [effect(name, 2, None) for name in there], [Shape.fixed(0.0) for _ in there])
    passed_over = 0
    for hypothesis in hypotheses(evidence.model.arm):
        if hypothesis.name in there or (trial := known.trial(hypothesis)) is None:
            continue
        gained = told(trial.score) - told(known.fit.score) + log_prior(evidence, [hypothesis])
        assert gained <= known._at_most(hypothesis, trial.shapes[-1].final, REFINEMENTS) + 1e-6
        if known.trial(hypothesis, PROMISING) is None:
            passed_over += 1
            assert gained < np.log(ALTERNATIVE)
        else:
            assert known.trial(hypothesis, PROMISING).score.error == trial.score.error  # type: ignore[union-attr]
    assert 20 < passed_over < len(hypotheses(evidence.model.arm)) - 2


def test_where_a_nonlinear_parameter_leads_is_heeded(evidence: Evidence) -> None:
    """An encoder that is off by 0.3 rad explains far more than its tangent at nothing."""
    model = evidence.model
    off = effect("encoder_offset", 2, None)
    samples = preprocess([run(1, 30.0)], model.conditioning)
    context = Evidence.of(model, samples, hypotheses(model.arm)).context
    shifted = replace(samples, tau=samples.tau + off.torque(context, {"offset": 0.3}))
    known = Known.of(Evidence.of(model, shifted, hypotheses(model.arm)))
    trial = known.trial(off)
    assert trial is not None
    gained = told(trial.score) - told(known.fit.score) + log_prior(known.evidence, [off])
    tangent, refined = (known._at_most(off, 0.0, often) for often in (0, REFINEMENTS))
    assert tangent < gained - 1.0 and gained <= refined + 0.5


@pytest.mark.parametrize(("bound", "fitted"), [(-3.9, True), (-4.1, False)])
def test_what_comes_near_enough_is_fitted(
    evidence: Evidence, bound: float, fitted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Known, "_at_most", lambda known, effect, shape, often: bound)
    trial = Known.of(evidence).trial(effect("viscous_friction", 2, None), -3.0)
    assert (trial is not None) == fitted


def test_joints_are_tied_by_columns_that_act_on_both() -> None:
    """Five joints of two rows each; every column is told by the joints that it acts on."""

    def columns(*each: tuple[int, ...]) -> Any:
        return np.array([[float(row // 2 in joints) for joints in each] for row in range(10)])

    def tied(new: Any, *known: tuple[int, ...]) -> list[int]:
        rows = SimpleNamespace(X=columns(*known).reshape(10, -1), joint=np.arange(10) // 2, joints=5)
        fit: Any = SimpleNamespace(stacked=rows)
        nothing: Any = None
        return np.flatnonzero(Known(nothing, np.zeros((1, 5)), fit)._tied(new)).tolist()

    assert tied(columns((0,))) == tied(columns((0,)), (1,), (3,)) == [0]
    assert tied(columns((0,), (4,))) == tied(columns((0, 4)), (2,)) == [0, 4]
    # a chain, in whichever order
    assert tied(columns((0,)), (2, 3), (1, 2), (0, 1)) == [0, 1, 2, 3]


def test_a_search_finds_what_it_finds_when_everything_is_fitted(
    evidence: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    screened = search(evidence, silent)
    monkeypatch.setattr(trials, "_SLACK", np.inf)
    whole = search(evidence, silent)
    named, everything = (
        [
            (f.effect.place, f.shape, f.share, [(rival.place, part) for rival, part in f.rivals])
            for f in each.found
        ]
        for each in (screened, whole)
    )
    assert named == everything and named
    assert screened.after.score.error == whole.after.score.error
