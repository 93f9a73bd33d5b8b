"""The loop by hand: what `track` measured is a log, and the motion that a diagnosis designs is tracked."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pydrake.trajectories import PiecewisePolynomial

import armloop as al
from armloop.cli import main
from armloop.drake.experiments.scenarios import load_plant, load_tracking
from armloop.drake.plant.exact import exact_model
from armloop.experiment.excitation import paper_reference
from armloop.util.errors import InputError, ScenarioError

SCENARIO = """
plant: three_axis
reference: {kind: fourier, duration: 20}
score: []
controllers: [pid_step3]
"""
EFFECTS = "effects: [{effect: coulomb_friction, joint: 2, parameters: {level: 0.5}}]\n"


def test_the_loop_by_hand(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "changed.yaml").write_text(SCENARIO + EFFECTS)
    plant = load_plant("three_axis")
    exact_model(plant.arm, plant.config.friction).save(tmp_path / "model.json")

    def run(line):
        assert main(line.split()) == 0, line

    run("track changed.yaml --model step3=model.json --out changed")
    run(
        "diagnose model.json changed/logs/pid_step3.csv --out found --next-run next.csv --next-run-duration 20"
    )
    found = json.loads((tmp_path / "found" / "diagnosis.json").read_text())
    (effect,) = found["effects"]
    level = effect["parameters"]["level"]
    assert (effect["effect"], effect["joint"]) == ("coulomb_friction", 2)
    assert abs(level["value"] - 0.5) < 3 * level["std_error"]
    run(
        "track changed.yaml --reference next.csv --model step3=model.json --model after=found/model.json --out next"
    )
    logs = [al.read_log(tmp_path / "next" / "logs" / f"{name}.csv") for name in ("pid_step3", "pid_after")]
    wanted = np.loadtxt(tmp_path / "next.csv", delimiter=",", skiprows=1)
    errors = []
    for log in logs:
        assert log.time[-1] == pytest.approx(20.0, abs=0.02)
        reference = np.interp(log.time, wanted[:, 0], wanted[:, 2])
        errors.append(np.abs(log.q[:, 1] - reference).mean())
    answer = json.loads((tmp_path / "next" / "tracking.json").read_text())
    assert answer["scored_s"] == [0.0, 20.0]
    eta = [answer["controllers"][name]["eta_deg"][1] for name in ("pid_step3", "pid_after")]
    np.testing.assert_allclose(np.rad2deg(errors), eta, rtol=0.02)
    assert eta[1] < 0.1 * eta[0]


def test_a_reference_beyond_what_a_model_was_trained_on_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.yaml").write_text(SCENARIO.replace("20", "6"))
    plant, wide = load_plant("three_axis"), [9.0, 9.0, 9.0]
    model = exact_model(plant.arm, plant.config.friction)
    for name, speeds in (("wide", wide), ("slow", [9.0, 0.2, 9.0])):
        replace(model, history={"range": [wide, speeds, [99.0] * 3, [0.0] * 3]}).save(
            tmp_path / f"{name}.json"
        )
    told = {}
    for name in ("wide", "slow"):
        assert main(["track", "s.yaml", "--model", f"step3={name}.json", "--out", name]) == 0
        told[name] = capsys.readouterr().err
    assert "trained" not in told["wide"]
    (line,) = [line for line in told["slow"].splitlines() if "trained" in line]
    assert "s, model step3: joint 2: " in line and "rad/s, trained up to 0.2); what it feeds forward" in line


def test_a_log_of_somebody_else_stays(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pid.yaml").write_text(SCENARIO.replace("pid_step3", "pid").replace("20", "5"))
    mine = tmp_path / "t" / "logs" / "pid.csv"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    assert main(["track", "pid.yaml", "--out", "t"]) == 2
    assert "logs/pid.csv: exists, and `armloop track` has not written it" in capsys.readouterr().err
    assert mine.read_text() == "mine" and not (tmp_path / "t" / "tracking.json").exists()
    mine.unlink()
    mine.parent.rmdir()
    mine.parent.write_text("a file")
    assert main(["track", "pid.yaml", "--out", "t"]) == 2
    assert "t/logs: is a file; --out must lie in a folder" in capsys.readouterr().err
    assert main(["loop", "--out", "t"]) == 2
    assert "t/logs: is a file; --out must name a folder" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "t").iterdir()] == ["logs"]


def test_what_is_wrong_with_the_effects_of_a_plant_is_told(tmp_path):
    path = tmp_path / "mine.yaml"
    for fields, message in (
        ("{effect: rust}", "effects: effect 'rust' is unknown; the plant can have: "),
        (
            "{effect: viscous_friction, parameters: {coefficient: 1}}",
            "effects: effect viscous_friction: joint must be",
        ),
        (
            "{effect: viscous_friction, joint: 4, parameters: {coefficient: 1}}",
            "effects: effect viscous_friction: .*4",
        ),
        (
            "{effect: viscous_friction, joint: 1, parameters: {level: 1}}",
            "effects: effect viscous_friction: .*level",
        ),
        ("{effect: payload, parameters: {mass: heavy}}", "effects.*mass"),
        ("{joint: 1}", "effects.*effect"),
        (
            "{effect: unlisted, joint: 1, parameters: {"
            + ", ".join(f"cos({k}*q1): 1" for k in range(101))
            + "}}",
            "parameters is .* a length of at most 100",
        ),
    ):
        path.write_text(f"{SCENARIO}effects: [{fields}]\n")
        with pytest.raises(ScenarioError, match=f"mine.yaml: .*{message}"):
            load_tracking(path)


def test_what_is_wrong_with_a_motion_is_told(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENARIO)
    header = "time,q1,q2,q3,v1,v2,v3,vdot1,vdot2,vdot3\n"
    far = tmp_path / "far.csv"
    far.write_text(header + "0,0,0,0,0,0,0,0,0,0\n700,0,0,0,0,0,0,0,0,0\n")
    two = tmp_path / "two.csv"
    two.write_text("time,q1,q2,v1,v2,vdot1,vdot2\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n")
    for name, message in (
        ("far.csv", "far.csv: the reference lasts 700 s; it must be at most 600 s"),
        ("two.csv", "two.csv: column q3 is missing"),
        ("none.csv", "none.csv"),
    ):
        with pytest.raises(InputError, match=message):
            load_tracking(tmp_path / "s.yaml", motion=tmp_path / name)
    wide = PiecewisePolynomial.FirstOrderHold([0.0, 1.0], [[0.0, 9.0]] * 3)
    for motion, message in (
        (np.zeros((9, 3)), "the reference must have evaluate.* it is of type ndarray"),
        (
            PiecewisePolynomial.FirstOrderHold([0.0, 1.0], [[0.0, 1.0]]),
            "the reference has 1 joints; three_axis has 3",
        ),
        (wide, "the reference: joint 1 would go from 0 to 8.9.; its limits are"),
    ):
        with pytest.raises(InputError, match=message):
            al.track(tmp_path / "s.yaml", reference=motion)


def test_the_log_of_a_tracking_from_python(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENARIO.replace("pid_step3", "pid").replace("20", "5"))
    log = al.track(tmp_path / "s.yaml", reference=paper_reference(periods=1)).results["pid"].log
    assert (
        log.joints == 3
        and log.name == "pid"
        and log.time[-1] == pytest.approx(20, abs=0.02)
        and log.period == pytest.approx(0.002)
    )
