"""An estimator of a user's own chooses terms under its name, and what is none is refused in one line."""

import numpy as np
import pytest

from armloop.cli import main
from armloop.regression.estimators import REGISTRY, Estimator, register_estimator
from armloop.regression.moments import Moments
from armloop.regression.sparse import Sparse
from armloop.util.errors import InputError


class Largest(Estimator):
    """Least squares on the two columns that correlate most with the signal."""

    name = "largest"
    least_squares, needs_parts = True, False

    def choose(self, problem):
        return problem.refitted(np.sort(np.argsort(np.abs(problem.moments.b))[-2:]))


@pytest.fixture(autouse=True)
def nothing_left_behind():
    REGISTRY.forget()
    yield
    REGISTRY.forget()


def test_it_is_found_by_its_name():
    with pytest.raises(ValueError, match="unknown estimator 'largest'; there are: evidence, lasso"):
        Sparse("largest")
    assert register_estimator(Largest) is Largest
    sparse = Sparse("largest")
    assert sparse.how.least_squares and not sparse.how.shrinks
    X = np.random.default_rng(0).normal(size=(500, 6))
    y = X @ [0.0, 2.0, 0.0, 0.0, -1.0, 0.3]
    support, beta = sparse.fit(Moments.of(X, y), np.array([5]))
    assert support.tolist() == [1, 4, 5]
    np.testing.assert_allclose(beta, [2.0, -1.0, 0.3], atol=1e-9)


def test_the_command_names_it(tmp_path, capsys):
    register_estimator(Largest)
    line = ["reconstruct", "nowhere.csv", "--arm", "scara", "--out", str(tmp_path / "model.json")]
    assert main([*line, "--estimator", "largest"]) == 2
    assert "nowhere.csv" in capsys.readouterr().err
    assert main([*line, "--estimator", "smallest"]) == 2
    assert "there are: evidence, lasso, " in (said := capsys.readouterr().err) and said.endswith("largest\n")


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (dict, "must be a subclass of armloop"),
        (type("Bare", (Estimator,), {"name": "bare"}), "Bare lacks choose; define them in the class"),
        (type("Lasso", (Largest,), {"name": "lasso"}), "the name 'lasso' is that of a listed estimator"),
    ],
)
def test_what_is_none_is_refused(kind, says):
    with pytest.raises(InputError, match=says):
        register_estimator(kind)
