"""Standard errors reach the model file under the terms' names and do not depend on how samples are cut."""

import json

import numpy as np
import pytest

from armloop.data.signals import independent_rows, preprocess
from armloop.identification.uncertainty import Fitted, standard_errors
from armloop.identification.uncertainty import standard_errors as module_function
from armloop.identification.uncertainty.solving import solve_given_terms
from armloop.model import load_model
from armloop.util.errors import ModelError
from armloop_paper.simulated import Disturbance, collection, true_model


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
    from dataclasses import replace

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
