"""The study of estimators tells the default from the Lasso, and counts terms as it says."""

from armloop_paper.estimators import CASES, estimators_table, study


def test_the_default_finds_the_terms_and_the_lasso_too_many():
    rows = {row.estimator: row for row in study(2, cases=CASES[:1], estimators=("evidence", "lasso"), jobs=1)}
    default, lasso, oracle = rows["evidence"], rows["lasso"], rows["oracle"]
    assert oracle.terms == 17
    assert (oracle.false, oracle.missed, oracle.error) == (0, 0, 1)
    assert default.exact == 2
    assert default.worst is not None
    assert default.worst < 1
    assert lasso.exact == 0
    assert lasso.terms == 17 + lasso.false - lasso.missed
    assert "evidence" in str(estimators_table(list(rows.values())))
