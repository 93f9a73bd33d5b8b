"""Standard errors reach the model file under the terms' names and do not depend on how samples are cut."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.signals import independent_rows, preprocess, smooth
from armloop.identification.uncertainty import Fitted, standard_errors, torque_errors
from armloop.identification.uncertainty import standard_errors as module_function
from armloop.identification.uncertainty.solving import solve_given_terms
from armloop.identification.uncertainty.unknowns import problems
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import load_model
from armloop.util.errors import ModelError
from armloop_paper.simulated import Disturbance, collection, true_model

standard = import_module("armloop.identification.uncertainty.standard_errors")


@pytest.fixture(scope="module")
def fit():
    design = collection(0, poses=10, segments=20, seconds=20.0)
    logs = design.logs(Disturbance("coloured", coloured=0.01), 1)
    samples = preprocess(logs, true_model().conditioning)
    fitted = [Fitted((1, 2, 3), samples.moving & independent_rows(samples)[:, None])]
    model, _ = solve_given_terms(true_model(), samples, fitted, 2)
    return model, samples, fitted


def test_every_coefficient_has_one_and_the_file_keeps_it(fit, tmp_path):
    model, samples, fitted = fit
    errors = standard_errors(model, samples, fitted)
    for j in range(3):
        names = {name for c in model.components for _, _, name in c.terms(model.arm, j)}
        assert set(errors["joints"][j]) == names
        assert set(errors["friction"][j]) == {t.name(j + 1) for t in model.friction.terms[j]} | {"v_s"}
        assert set(errors["stribeck"][j]) == {"static", "coulomb", "viscous", "stribeck_velocity"}
        for entry in (*errors["joints"][j].values(), *errors["friction"][j].values()):
            assert 0 < entry["std_error"] < 10 and entry["degrees_of_freedom"] >= 1
    replace(model, uncertainty=errors).save(tmp_path / "model.json")
    assert load_model(tmp_path / "model.json").uncertainty == errors
    # files from before there were standard errors, and files somebody broke
    data = json.loads((tmp_path / "model.json").read_text())
    del data["uncertainty"]
    data["schema"] = "armloop/model/1"
    (tmp_path / "old.json").write_text(json.dumps(data))
    assert load_model(tmp_path / "old.json").uncertainty == {}
    data["uncertainty"] = {**errors, "joints": errors["joints"][:2]}
    (tmp_path / "broken.json").write_text(json.dumps(data))
    with pytest.raises(ModelError, match=r"uncertainty\.joints: 2 joints, the arm has 3"):
        load_model(tmp_path / "broken.json")


def test_the_coulomb_level_is_the_sum_of_two_coefficients_that_are_correlated(fit):
    model, samples, fitted = fit
    errors = standard_errors(model, samples, fitted)
    for j in range(3):
        parts = errors["friction"][j]
        static = parts[f"sign(v{j + 1})"]["std_error"]
        excess = next(e["std_error"] for name, e in parts.items() if name.startswith("(1-exp"))
        assert errors["stribeck"][j]["static"]["std_error"] == pytest.approx(static)
        assert errors["stribeck"][j]["coulomb"]["std_error"] < 0.9 * np.hypot(static, excess)


def test_the_level_that_several_elements_share_is_known_better_than_any_of_them(fit: Any) -> None:
    """A direction written as two that fade in: neither is well determined, their sum is, and is stated."""
    model, samples, fitted = fit
    fall, *others = _as_fall(model.friction.terms[0])[1:]
    level = sum(t.coefficient for t in model.friction.terms[0] if t.kind in ("sign", "stribeck"))
    halves = [FrictionTerm("smooth_sign", level / 2, width) for width in (0.002, 0.02)]
    law = FrictionLaw(((*halves, fall, *others), *model.friction.terms[1:]))
    errors = standard_errors(replace(model, friction=law), samples, fitted)
    parts = [errors["friction"][0][term.name(1)]["std_error"] for term in halves]
    found = errors["stribeck"][0]["coulomb"]
    assert found["value"] == pytest.approx(level)
    assert found["std_error"] < min(parts)


def test_the_same_law_as_a_fall_has_the_same_errors_of_its_velocity_too(fit: Any) -> None:
    """Level and rise, or level and fall onto it: f_s, f_c, f_v and v_s are the same numbers."""
    model, samples, fitted = fit
    as_rise = standard_errors(model, samples, fitted)["stribeck"]
    other = replace(model, friction=FrictionLaw(tuple(map(_as_fall, model.friction.terms))))
    as_fall = standard_errors(other, samples, fitted)
    for j, (rise, fall) in enumerate(zip(as_rise, as_fall["stribeck"], strict=True)):
        assert set(rise) == set(fall) == {"static", "coulomb", "viscous", "stribeck_velocity"}
        assert as_fall["friction"][j]["v_s"]["std_error"] == fall["stribeck_velocity"]["std_error"]
        for key, one in rise.items():
            assert fall[key]["value"] == pytest.approx(one["value"])
            assert fall[key]["std_error"] == pytest.approx(one["std_error"], rel=1e-3)


def test_a_file_from_before_the_falls_velocity_was_unknown_still_tells_the_torques_errors(fit: Any) -> None:
    model, samples, fitted = fit
    model = replace(model, friction=FrictionLaw(tuple(map(_as_fall, model.friction.terms))))
    errors = standard_errors(model, samples, fitted)
    now = torque_errors(replace(model, uncertainty=errors), samples)
    for one in errors["torque"]:
        kept = [k for k, name in enumerate(one["unknowns"]) if name != "v_s"]
        one["unknowns"] = [one["unknowns"][k] for k in kept]
        one["directions"] = [one["directions"][k] for k in kept]
    before = torque_errors(replace(model, uncertainty=errors), samples)
    assert before.shape == now.shape and 0 < np.linalg.norm(before) < np.linalg.norm(now)


def _as_fall(law: Sequence[FrictionTerm]) -> tuple[FrictionTerm, ...]:
    """f_s sign(v) with the rise to f_c, written as f_c with the fall from f_s; other terms as they are."""
    sign, rise = (next(term for term in law if term.kind == kind) for kind in ("sign", "stribeck"))
    return (
        FrictionTerm("smooth_sign", sign.coefficient + rise.coefficient, 1e-9),
        FrictionTerm("stribeck_peak", -rise.coefficient, rise.parameter),
        *(term for term in law if term not in (sign, rise)),
    )


def test_pieces_do_not_show(fit, monkeypatch):
    model, samples, fitted = fit
    whole = standard_errors(model, samples, fitted)
    import sys

    monkeypatch.setattr(sys.modules[module_function.__module__], "_PIECE", 700)
    cut = standard_errors(model, samples, fitted)
    for j in range(3):
        for name, entry in whole["joints"][j].items():
            assert cut["joints"][j][name]["std_error"] == pytest.approx(entry["std_error"], rel=1e-3)


def test_truth_lies_within_a_few_standard_errors(fit):
    model, samples, fitted = fit
    errors, truth = standard_errors(model, samples, fitted), true_model()
    for j in range(3):
        found = errors["stribeck"][j]
        for key, value in truth.friction.stribeck_parameters(j).items():
            assert abs(found[key]["value"] - value) < 5 * found[key]["std_error"]


@pytest.mark.parametrize("late", [-0.002, 0.004])
def test_a_torque_that_is_out_of_step_is_part_of_the_errors(fit: Any, late: float) -> None:
    """Recorded earlier or later than the motion, as where channels are read one after the other."""
    logs = collection(0, poses=10, segments=20, seconds=20.0).logs(Disturbance("white"), 1)
    shifted = [
        replace(log, tau=np.stack([np.interp(log.time - late, log.time, x) for x in log.tau.T], axis=1))
        for log in logs
    ]
    samples = preprocess(shifted, true_model().conditioning)
    fitted = [Fitted((1, 2, 3), samples.moving & independent_rows(samples)[:, None])]
    _, parts = solve_given_terms(true_model(), samples, fitted, 2)
    assert standard.torque_lag([part.equations for part in parts]) == pytest.approx(late, abs=4e-4)
    worst = 0.0
    for part, truth in zip(parts, map(partial(_values, true_model()), range(3)), strict=True):
        wrong = np.array([u.value for u in part.unknowns]) - truth
        spread = np.sqrt(np.diag(part.equations.covariance()))
        worst = max(worst, np.abs(wrong / spread).max())
        assert (np.abs(wrong / part.std_error) < 3.0).all()
    assert worst > 5.0, "of the spread between blocks alone"


def test_what_is_out_of_step_is_an_error_of_the_torque_of_a_later_run(fit: Any) -> None:
    model, samples, fitted = fit
    errors = {**standard_errors(model, samples, fitted), "torque_lag": 0.003}
    late, in_step = (
        torque_errors(replace(model, uncertainty=one), samples)
        for one in (errors, {**errors, "torque_lag": 0.0})
    )
    np.testing.assert_array_equal(late[:, :, : in_step.shape[2]], in_step)
    run = max(samples.motion.runs(), key=lambda run: run.stop - run.start)
    time, torque = samples.motion.time[run], smooth(samples, model.predict(samples.motion))[run]
    difference = torque - np.stack([np.interp(time - 0.003, time, x) for x in torque.T], axis=1)
    own = late[run, :, -1]
    assert np.sum(own * difference) / np.sum(own**2) == pytest.approx(1.0, abs=0.1)


def _values(model: Any, joint: int) -> Any:
    return np.array([unknown.value for unknown in problems(model)[joint].unknowns])


def test_blocks_suit_the_slowest_residual_and_the_shortest_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two joints; regressions of which the second uses but the first half; every other sample of a second one left out."""
    time = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 9.0])
    motion = SimpleNamespace(time=time)
    rows = [np.ones((6, 2), dtype=bool), np.zeros((6, 2), dtype=bool)]
    rows[0][:, 1] = False
    rows[1][:3, 1] = True
    asked: dict[str, Any] = {"covered": []}

    def correlation_time(residual: Any, used: Any, motion: Any, step: float) -> float:
        asked["step"] = step
        assert used.tolist() == [[True] * 6, [True] * 3 + [False] * 3][int(residual[0])]
        return [3.0, 4.0][int(residual[0])]

    def covered_time(time: Any, used: Any) -> float:
        asked["covered"].append(used.tolist())
        return [50.0, 20.0][len(asked["covered"]) - 1]

    most = standard.MOST_UNKNOWNS
    todo = [SimpleNamespace(unknowns=[0] * count) for count in (0, 1, most, most + 1)]
    monkeypatch.setattr(standard, "problems", lambda model: todo)
    monkeypatch.setattr(standard, "_residuals", lambda *_: (np.tile([0.0, 1.0], (6, 1)), None))
    monkeypatch.setattr(standard, "correlation_time", correlation_time)
    monkeypatch.setattr(standard, "covered_time", covered_time)
    monkeypatch.setattr(standard, "block_length", lambda correlation, covered: 10 * correlation + covered)

    def independent_blocks(motion: Any, seconds: float) -> Any:
        asked["seconds"] = seconds
        return np.array([0, 0, 1, 1, 2, 2])

    monkeypatch.setattr(standard, "independent_blocks", independent_blocks)
    monkeypatch.setattr(standard, "log_numbers", lambda motion: np.array([0, 0, 0, 0, 1, 1]))
    by_logs, apart = SimpleNamespace(), standard.Heterogeneity(3.0)

    def of_logs(sums: Any, logs: Any, covariance: Any) -> Any:
        asked["logs"] = logs.tolist()
        return by_logs

    def of_all(told: Any, blocks: int) -> Any:
        assert [each for each, _ in told] == [by_logs] * 2 and blocks == 3
        return apart

    monkeypatch.setattr(standard.ByLogs, "of", of_logs)
    monkeypatch.setattr(standard.Heterogeneity, "of", of_all)
    sums = SimpleNamespace(
        covariance=lambda: 0.0,
        degrees_of_freedom=lambda: None,
        late=lambda: (0.0, 0.0),
        shifted=lambda: np.zeros(1),
    )
    sums.met = sums
    monkeypatch.setattr(standard, "_equations", lambda *_: sums)
    model: Any = SimpleNamespace(arm=SimpleNamespace(n=2))
    samples: Any = SimpleNamespace(motion=motion)
    fitted: Any = [SimpleNamespace(rows=each) for each in rows]
    found, seconds, correlation = standard.covariances(model, samples, fitted)
    assert (correlation, seconds, asked["seconds"], asked["step"]) == (4.0, 60.0, 60.0, 0.5)
    assert asked["logs"] == [0, 0, 1]
    assert all(each.by_logs is by_logs and each.heterogeneity is apart for each in found)
    assert asked["covered"] == [[True] * 6, [True] * 3 + [False] * 3]
    assert [len(each.unknowns) for each in found] == [1, most]


def test_errors_are_roots_of_variances_that_rounding_made_no_less_than_none() -> None:
    nothing: Any = None
    errors = standard.Errors([], np.diag([4.0, -1e-20, 0.25]), np.ones(3), nothing)
    assert errors.std_error.tolist() == [2.0, 0.0, 0.5]


def unknown(name: str, joint: int | None, value: float = 0.0, kind: str = "friction") -> Any:
    return SimpleNamespace(name=name, joint=joint, value=value, kind=kind)


class TestWhatIsNotDetermined:
    """A coefficient of the bodies whose column is twice that of one of the friction's, in one regression or in two."""

    def errors(self, stage: tuple[int, ...] = (0, 0, 0)) -> Any:
        X = np.random.default_rng(0).normal(size=(30, 3))
        X[:, 0] = 2 * X[:, 2]
        unknowns = [
            unknown("mass", None, 3.0, "shared"),
            unknown("drag", 1, 5.0, "joints"),
            unknown("viscous", 1, 7.0),
        ]
        equations = SimpleNamespace(
            jacobian=np.array([X[:10].T @ X[:10], X[10:].T @ X[10:]]), stage=np.array(stage)
        )
        return standard.Errors(unknowns, np.diag([4.0, 1.0, 9.0]), np.ones(3), equations)

    def test_the_friction_stays_and_the_sum_has_a_standard_error(self) -> None:
        entry, mine = self.errors().undetermined()
        assert (entry["joint"], entry["coefficients"], entry["sums"]) == (None, ["mass"], [])
        assert (mine["joint"], mine["coefficients"]) == (2, [])
        (told,) = mine["sums"]
        assert told["sum"] == "viscous + 2 mass"
        assert told["value"] == pytest.approx(7 + 2 * 3) and told["std_error"] == pytest.approx(
            np.sqrt(9 + 4 * 4)
        )

    def test_what_another_regression_found_is_told_apart(self) -> None:
        errors = self.errors((0, 0, 1))
        assert errors.undetermined() == []
        # products within a regression alone, in units of what it left
        G = errors.equations.jacobian.sum(axis=0)
        errors.equations.variance = np.array([2.0, 2.0, 4.0])
        G[:2, 2] = G[2, :2] = 0.0
        np.testing.assert_allclose(errors.gram, np.diag([1 / 2, 1 / 2, 1 / 4]) @ G)

    def test_a_joints_own_coefficient_is_told_with_its_joint(self) -> None:
        errors = self.errors()
        errors.unknowns[0] = unknown("inertia", 1, 3.0, "joints")
        assert errors.undetermined()[0]["joint"] == 2
        errors.covariance[:] = -1e-20
        assert errors.undetermined()[0]["sums"][0]["std_error"] == 0.0

    def test_what_is_lost_is_told_joint_by_joint(self) -> None:
        """Of a regression of several joints, each of whose friction holds a column twice."""
        X = np.random.default_rng(0).normal(size=(30, 5))
        X[:, 2], X[:, 4] = X[:, 1], 3 * X[:, 3]
        unknowns = [
            unknown("mass", None, 3.0, "shared"),
            *(unknown(f"{name}{j + 1}", j, float(j + 1)) for j in range(2) for name in ("a", "b")),
        ]
        equations: Any = SimpleNamespace(jacobian=(X.T @ X)[None], stage=np.zeros(5, dtype=int))
        told = standard.Errors(unknowns, np.eye(5), np.ones(5), equations).undetermined()
        assert [(one["joint"], one["coefficients"], [s["sum"] for s in one["sums"]]) for one in told] == [
            (1, ["b1"], ["a1 + b1"]),
            (2, ["b2"], ["a2 + 3 b2"]),
        ]


def test_levels_of_stribeck_friction_are_sums_with_the_fewest_degrees_of_freedom() -> None:
    terms = (FrictionTerm("sign", 0.5), FrictionTerm("stribeck", -0.2, 0.3), FrictionTerm("viscous", 2.0))
    names = [term.name(2) for term in terms]
    unknowns = [
        *(unknown(name, 1) for name in names),
        unknown("v_s", 1),
        unknown(names[0], 0),
        unknown(names[0], 1, kind="x"),
    ]
    covariance = np.diag([4.0, 9.0, 16.0, 25.0, 99.0, 99.0])
    covariance[0, 1] = covariance[1, 0] = -2.0
    nothing: Any = None
    part = standard.Errors(unknowns, covariance, np.array([30.0, 20.0, 10.04, 40.0, 1.0, 1.0]), nothing)
    model: Any = SimpleNamespace(friction=FrictionLaw(((), terms)))
    found = standard._stribeck(model, [part], 1)
    assert {key: (e["value"], e["degrees_of_freedom"]) for key, e in found.items()} == {
        "static": (0.5, 30.0),
        "coulomb": (0.3, 20.0),
        "stribeck_velocity": (0.3, 40.0),
        "viscous": (2.0, 10.0),
    }
    errors = {key: e["std_error"] for key, e in found.items()}
    assert errors == pytest.approx({"static": 2.0, "coulomb": 3.0, "stribeck_velocity": 5.0, "viscous": 4.0})
    assert standard._stribeck(model, [part], 0) == {}
    # of viscous friction of either direction the mean, with their covariance
    ways = (FrictionTerm("viscous_forward", 3.0), FrictionTerm("viscous_backward", 1.0))
    both = FrictionLaw(((), (terms[0], *ways)))
    unknowns = [unknown(term.name(2), 1) for term in both.terms[1]]
    covariance = np.array([[1.0, 0.0, 0.0], [0.0, 4.0, 2.0], [0.0, 2.0, 9.0]])
    part = standard.Errors(unknowns, covariance, np.array([30.0, 20.0, 40.0]), nothing)
    viscous = standard._stribeck(SimpleNamespace(friction=both), [part], 1)["viscous"]  # type: ignore[arg-type]
    assert (viscous["value"], viscous["degrees_of_freedom"]) == (2.0, 20.0)
    assert viscous["std_error"] == pytest.approx(np.sqrt((4 + 9 + 2 * 2) / 4))


def test_a_model_keeps_errors_where_they_belong_and_none_that_is_no_number(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of two joints: what the fitted samples do not determine has no error, or no degrees of freedom."""
    nothing: Any = None
    errors_of = [(1.0, 10.0), (np.inf, 20.0), (2.0, 30.0), (3.0, 40.0)]
    first = SimpleNamespace(
        equations=SimpleNamespace(late=lambda: (3.0, 4.0)),
        of_sum=lambda weights: errors_of[int(np.argmax(weights))],
        unknowns=[
            unknown("a", 0, kind="joints"),
            unknown("b", 1, kind="joints"),
            unknown("c", 1),
            unknown("d", None, kind="shared"),
        ],
        covariance="covariance",
        gram="gram",
        heterogeneity=SimpleNamespace(usual=2.0),
        undetermined=lambda: ["one"],
    )
    second = SimpleNamespace(**vars(first))
    second.unknowns = [unknown("e", 0), unknown("f", 0)]
    second.of_sum = lambda weights: [(4.0, np.nan), (5.0, 50.0)][int(np.argmax(weights))]
    rows = [np.array([[True, False], [False, False]]), np.array([[False, False], [False, True]])]
    monkeypatch.setattr(standard, "covariances", lambda *_: ([first, second], 7.0, 0.5))
    monkeypatch.setattr(standard, "_stribeck", lambda model, parts, joint: f"law {joint}")
    monkeypatch.setattr(
        standard, "_line", lambda model, parts, joint, samples, used: f"line {joint} {used.tolist()}"
    )
    monkeypatch.setattr(standard, "leading", lambda covariance, gram: (covariance, gram))
    monkeypatch.setattr(standard, "to_dict", lambda unknowns, directions: (len(unknowns), *directions))
    model: Any = SimpleNamespace(arm=SimpleNamespace(n=2))
    kept = standard_errors(model, nothing, [SimpleNamespace(rows=one) for one in rows])  # type: ignore[misc]

    def errors(table: dict[str, Any]) -> dict[str, float]:
        return {name: entry["std_error"] for name, entry in table.items()}

    assert [errors(own) for own in kept["joints"]] == [{"a": 1.0}, {}]
    assert [errors(own) for own in kept["friction"]] == [{"f": 5.0}, {"c": 2.0}]
    assert errors(kept["shared"]) == {"d": 3.0} and kept["shared"]["d"]["degrees_of_freedom"] == 40.0
    assert kept["undetermined"] == ["one", "one"] and kept["stribeck"] == ["law 0", "law 1"]
    assert kept["friction_line"] == ["line 0 [True, False]", "line 1 [False, True]"]
    assert kept["torque"] == [(4, "covariance", "gram"), (2, "covariance", "gram")]
    assert (kept["block_seconds"], kept["correlation_seconds"], kept["heterogeneity"]) == (7.0, 0.5, 2.0)
