"""The study of estimators tells the default from the Lasso, and counts terms as it says."""

from armloop_paper.estimator_trials import ORACLE, Trial
from armloop_paper.estimators import CASES, _rows, estimators_table, study


def test_the_default_finds_the_terms_and_the_lasso_too_many():
    rows = {row.estimator: row for row in study(1, cases=CASES[:1], estimators=("evidence", "lasso"), jobs=1)}
    default, lasso, oracle = rows["evidence"], rows["lasso"], rows["oracle"]
    assert oracle.terms == 17
    assert (oracle.false, oracle.missed, oracle.error) == (0, 0, 1)
    assert default.exact == 1
    assert default.worst is not None
    assert default.worst < 1
    assert lasso.exact == 0
    assert lasso.terms == 17 + lasso.false - lasso.missed
    assert "evidence" in str(estimators_table(list(rows.values())))


def test_a_row_is_of_all_draws_and_its_errors_are_over_the_oracles_of_the_same_draw():
    oracle = [Trial(ORACLE, draw, 17, 0, 0, [1.0 + draw, 2.0 + 2 * draw]) for draw in range(2)]
    some = [Trial("some", 0, 17, 0, 0, [1.0, 1.0]), Trial("some", 1, 18, 1, 0, [2.0, 12.0])]
    none = [Trial("none", 0, 16, 0, 1, [1.5, 2.0]), Trial("none", 1, 19, 2, 0, [2.0, 4.0])]
    _, first, second = _rows(CASES[0], [*oracle, *some, *none])
    assert (first.draws, first.exact, first.nearly, first.terms) == (2, 1, 2, 17.5)
    assert (first.false, first.missed, first.error, first.worst) == (0.5, 0.0, 2.0, 1.0)
    assert (second.exact, second.nearly, second.worst) == (0, 0, None)
    assert (second.false, second.missed, second.error) == (1.0, 0.5, 1.25)
