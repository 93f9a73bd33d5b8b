"""The reproduction: the paper's counts, the shape of its JSON, and the numerics behind the noise studies."""

import json
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from answers import answered

from armloop.cli import main
from armloop.data.motion import Motion
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop_paper import ITEMS, Context, chosen, fig5, fig6, paper, registry
from armloop_paper.experiments import SCARA, STEPS, THREE_AXIS, as_motion
from armloop_paper.gram import library_moments
from armloop_paper.lasso import TOLERANCE, duality_gap, lasso
from armloop_paper.methods import one_shot, stepwise
from armloop_paper.noise_study import least_counts
from armloop_paper.outcome import Outcome
from armloop_paper.paper import SCARA_SNR, THREE_AXIS_SNR
from armloop_paper.readings import READINGS, Reading, collected
from armloop_paper.sorting_motion import sorting_motion
from armloop_paper.spread import in_words, spread


def random_motion(n, samples, seed=0):
    q, v, vdot = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, samples, n))
    return Motion(np.arange(float(samples)), q, v, vdot, np.array([0]))


@pytest.mark.parametrize(
    ("experiment", "candidates", "samples"),
    [
        (SCARA, paper.SCARA_CANDIDATES, paper.SCARA_SAMPLES),
        (THREE_AXIS, paper.THREE_AXIS_CANDIDATES, paper.THREE_AXIS_SAMPLES),
    ],
)
def test_libraries_and_samples_are_the_papers(experiment, candidates, samples):
    assert {part: experiment.library(part).size for part in ("sindy", *STEPS)} == candidates
    assert sum(experiment.counts) == samples["sindy"]
    assert list(experiment.counts) == [samples[step] for step in STEPS]


@pytest.mark.parametrize(
    "library",
    [
        DoubleFeatureSet((True, True, True), 2, 2, "both", independent=False),
        DoubleFeatureSet((True, False), 3, 1, "velocity", independent=False),
        DoubleFeatureSet((True, True), 2, 0, "none", independent=True),
    ],
)
def test_normal_equations_by_look_up_are_those_of_the_columns(library):
    motion = random_motion(len(library.revolute), 1500)
    tau = np.random.default_rng(1).normal(size=motion.q.shape)
    G, B = library_moments(library, motion, tau)
    Y = library.columns(motion)
    np.testing.assert_allclose(G, Y.T @ Y, atol=1e-9 * np.abs(G).max())
    np.testing.assert_allclose(B, Y.T @ tau, atol=1e-9 * np.abs(G).max())


@pytest.mark.parametrize("penalty", [300.0, 3.0, 0.03])
def test_lasso_is_optimal_on_redundant_columns(penalty):
    library = DoubleFeatureSet((True, True), 3, 1, "both", independent=False)
    motion = random_motion(2, 600)
    rng = np.random.default_rng(2)
    Y = library.columns(motion)
    assert np.linalg.matrix_rank(Y) < library.size
    y = Y[:, :4] @ [1.0, -2.0, 0.5, 3.0] + 0.1 * rng.normal(size=600)
    G, b, yy = Y.T @ Y, Y.T @ y, float(y @ y)
    xi = lasso(G, b, yy, penalty)
    assert duality_gap(b, b - G @ xi, yy, penalty, xi) <= TOLERANCE
    slope = Y.T @ (y - Y @ xi)
    assert np.abs(slope).max() <= penalty * (1 + 0.05)

    def objective(x):
        return 0.5 * np.sum((y - Y @ x) ** 2) + penalty * np.abs(x).sum()

    for _ in range(20):
        step = rng.normal(size=len(xi)) * (np.abs(xi) + 0.01) * 0.1
        assert objective(xi + step) >= objective(xi) * (1 - 2 * TOLERANCE)


def test_the_literal_reading_minimises_the_norm_not_squared():
    small = replace(SCARA, counts=(200, 400, 400))
    logs = collected(small, (60.0, 40.0, 20.0), 3, Reading())
    motion, tau = as_motion(*logs.values())
    xi = one_shot(small, logs, Reading()).parts[0][1][:, 1]
    Y, y = small.library("sindy").columns(motion), tau[:, 1]

    def objective(x):
        return np.linalg.norm(y - Y @ x) + small.penalty * np.abs(x).sum()

    rng = np.random.default_rng(0)
    assert objective(xi) < objective(np.zeros_like(xi))
    for factor in (0.99, 1.01):
        assert objective(factor * xi) > objective(xi)
    for _ in range(20):
        assert objective(xi + 0.02 * rng.normal(size=len(xi)) * np.abs(xi)) > objective(xi) * (1 - 1e-4)


def test_noise_has_the_stated_ratio():
    exact = collected(SCARA, None, 5, Reading())
    for how in ("joint", "matrix", "unit", "record"):
        noisy = collected(SCARA, (60.0, 40.0, 20.0), 5, Reading(noise=how))
        noise = np.asarray(noisy["varying"].vdot) - np.asarray(exact["varying"].vdot)
        power = np.mean(np.asarray(exact["varying"].vdot) ** 2, axis=0)
        reference = {
            "joint": power,
            "matrix": np.full(4, power.mean()),
            "unit": np.ones(4),
            "record": np.full(4, 0.4 * power.mean()),
        }[how]
        np.testing.assert_allclose(np.mean(noise**2, axis=0), reference / 100, rtol=0.1)
        assert noisy["static"].v.any() == (how == "record")
        np.testing.assert_array_equal(noisy["varying"].tau, exact["varying"].tau)


@pytest.mark.parametrize(
    ("experiment", "snr"), [(SCARA, SCARA_SNR), *((THREE_AXIS, snr) for snr in THREE_AXIS_SNR.values())]
)
def test_every_reading_draws_logs_that_an_arm_can_have_made(experiment, snr):
    """The checks of a log hold for them, too: an item that tries all readings must not end at one of them."""
    for reading in {(one.noise, one.sampling): one for one in READINGS}.values():
        logs = collected(experiment, snr, 0, reading)
        assert [log.samples for log in logs.values()] == list(experiment.counts)
    apart = next(one for one in READINGS if one.sampling == "trajectories")
    assert len(collected(experiment, None, 0, apart)["varying"].runs()) == 10


def test_stepwise_is_exact_without_noise_and_penalty():
    reading = Reading("½‖r‖²", factor=1e-7)
    logs = collected(SCARA, None, 0, reading)
    beyond = SCARA.beyond_range()
    truth = SCARA.torque(beyond)
    error = stepwise(SCARA, logs, reading).predict(beyond) - truth
    assert np.abs(error).max() < 1e-3 * np.abs(truth).max()


def test_the_sorting_motion_is_smooth_and_truly_labelled():
    motion, truth = sorting_motion(SCARA.ranges, 0.5, 1, moves=4)
    np.testing.assert_allclose(np.gradient(motion.q, motion.time, axis=0), motion.v, atol=0.02)
    assert not motion.v[truth == 1].any() and not motion.vdot[truth == 2].any()
    assert np.all(np.abs(motion.v).max(axis=0) <= 0.5 * SCARA.ranges.velocity + 1e-9)
    assert np.all(np.abs(motion.vdot).max(axis=0) <= SCARA.ranges.acceleration + 1e-9)
    assert set(truth) == {1, 2, 3}


def test_a_printed_percentage_tells_the_least_number_of_terms():
    assert least_counts(50.0, 2) == (1, 2)
    stepwise_terms, sindy = least_counts(83.34, 2)
    assert abs(100 * (1 - stepwise_terms / sindy) - 83.34) < 0.01
    for few in range(1, 400):
        for many in range(few, min(6 * few + 8, sindy)):
            exact = 100 * (1 - few / many)
            assert not (83.335 <= exact < 83.345), (few, many)


def test_both_sides_must_have_the_same_keys():
    section = fig6.Section("x")
    with pytest.raises(ValueError, match="different keys"):
        Outcome({"a": {"b": 1}}, {"a": {"c": 1}}, "agrees", "", section)


@pytest.fixture(scope="module")
def small_run():
    context = Context(draws=2, reading_draws=1, processes=1)
    readings, fig5_readings = READINGS[:2], READINGS
    import armloop_paper.noise_study as study

    study.READINGS = readings
    try:
        yield {"fig5": fig5.run(context), "fig6": fig6.run(context)}
    finally:
        study.READINGS = fig5_readings


def test_few_draws_show_what_the_paper_shows(small_run):
    assert min(small_run["fig5"].ours["reduction_percent"]) > 50
    assert small_run["fig5"].details["active"]["armloop"]["draws"] == 2
    assert len(small_run["fig5"].details["readings"]) == 2
    json.dumps({name: outcome.to_dict() for name, outcome in small_run.items()})


def test_the_command_writes_what_it_prints(tmp_path, capsys, small_run, monkeypatch):
    monkeypatch.setattr(registry, "run_item", lambda name, context: small_run[name])
    monkeypatch.setattr("armloop_paper.run_item", lambda name, context: small_run[name])
    out = tmp_path / "out"
    assert main(["reproduce", "fig6", "fig5", "--out", str(out), "--json"]) == 0
    printed = answered(capsys.readouterr().out, "reproduction")
    written = answered((out / "reproduction.json").read_text(), "reproduction")
    assert written.pop("written_by") == "armloop reproduce"
    assert printed == written
    assert list(printed) == ["fig5", "fig6"]
    for item in printed.values():
        assert set(item["paper"]) == set(item["ours"])
    page = (out / "report.html").read_text()
    assert (
        "<svg" in page and "http://" not in page.replace("http://www.w3.org", "") and "https://" not in page
    )
    assert main(["reproduce", "fig5", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "Readings of the recipe" in text and "87.1" in text


def test_table2_has_the_fields_that_scripts_read():
    outcome = registry.run_item("table2", Context(processes=1, repeats=1))
    candidates = {"sindy": 360, "step1": 8, "step2": 120, "step3": 40}
    for side in (outcome.paper, outcome.ours):
        assert side["candidates"] == candidates
        assert set(side["seconds"]) == set(candidates)
    assert outcome.ours["time_ratio"] > 1


@pytest.mark.parametrize("arguments", [["fig7"], ["table2", "nothing"]])
def test_an_unknown_item_is_one_line_that_lists_the_items(arguments, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["reproduce", *arguments, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and all(item in captured.err for item in ITEMS)
    assert not captured.out and not out.exists()


def test_the_place_and_the_number_of_draws_are_checked_first(tmp_path, capsys):
    (tmp_path / "file").write_text("here")
    assert main(["reproduce", "table2", "--out", str(tmp_path / "file")]) == 2
    assert "is a file" in capsys.readouterr().err
    assert main(["reproduce", "table2", "--draws", "0", "--out", str(tmp_path / "out")]) == 2
    assert "--draws" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_items_come_in_the_papers_order():
    assert chosen(["fig9", "table2"]) == ["table2", "fig9"]
    assert chosen([]) == list(registry.PAPER)


def test_every_item_beyond_the_paper_has_its_module():
    for name in registry.BEYOND:
        assert name not in registry.PAPER
        assert find_spec(f"armloop_paper.beyond_{name}") is not None
    outcome = registry.run_item("friction", Context(draws=1, processes=1))
    assert abs(outcome.ours["profile"]["median"][2] - 0.1) < 0.01


def test_spread_leaves_out_what_is_not_finite():
    assert spread([[1.0, np.nan], [3.0, np.nan]]) == {
        "median": [2.0, None],
        "least": [1.0, None],
        "largest": [3.0, None],
        "draws": 2,
    }
    assert in_words([4.0, 6.0, np.nan, 5.0]) == "5 (4–6)"
    assert in_words([0.25, 1.0]) == "0.625 (0.250–1.00)"
