"""Effects that cannot be worth it are passed over before they are fitted: the answers are as if they had not been."""

from dataclasses import replace

import numpy as np
import pytest
from rubbing_arm import model_with_baseline, run

from armloop.data.signals import preprocess
from armloop.diagnosis import trials
from armloop.diagnosis.evidence import Evidence
from armloop.diagnosis.fit import Shape
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
        assert gained <= known._at_most(hypothesis, trial.shapes[-1].final, True) + 1e-6
        if known.trial(hypothesis, PROMISING) is None:
            passed_over += 1
            assert gained < np.log(ALTERNATIVE)
        else:
            assert known.trial(hypothesis, PROMISING).score.error == trial.score.error  # type: ignore[union-attr]
    assert 20 < passed_over < len(hypotheses(evidence.model.arm)) - 2


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
