"""Laws that an arm had all along are found in its training data, with their parameters; a bare arm has none."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, write_log
from armloop.data.motion import Motion
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.model import load_model

Array = NDArray[np.float64]
PLAIN = Options(standard_errors=False, parts=False)
COUPLING = {"inertia": 0.05, "viscous": 0.4, "coulomb": 0.5}
SPRING = {"stiffness": 6.0, "rest": 0.3}


def coupled(motion: Motion, ratio: float = -1.0) -> Array:
    """A motor that turns with v2 ± v3."""
    v, vdot = motion.v, motion.vdot
    w, rate = v[:, 1] + ratio * v[:, 2], vdot[:, 1] + ratio * vdot[:, 2]
    torque = COUPLING["inertia"] * rate + COUPLING["viscous"] * w + COUPLING["coulomb"] * np.sign(w)
    return np.outer(torque, [0, 1, ratio])


def sprung(motion: Motion) -> Array:
    return np.outer(SPRING["stiffness"] * (motion.q[:, 1] - SPRING["rest"]), [0, 1, 0])


def made(laws: list, seed: int = 0, seconds: float = 40, library: str = "rigid-body") -> Reconstruction:
    return reconstruct([run(laws, seed, seconds)], three_axis(), library=library, options=PLAIN)


def run(laws: list, seed: int = 0, seconds: float = 40) -> MotionLog:
    motion = fourier_motion(seconds, 100, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau + sum(law(motion) for law in laws), seed, name="run")


def named(made: Reconstruction) -> list[tuple[str, int | None, int | None]]:
    return [added.effect.place for added in made.model.effects]


def check(added, truth: dict[str, float]) -> None:
    """Within four standard errors, which are small."""
    for key, value in truth.items():
        found = added.parameters[key]
        assert abs(found.value - value) < 4 * found.std_error + 0.02 * abs(value), key


@pytest.mark.parametrize("seed", range(3))
def test_a_bare_arm_has_none(seed: int) -> None:
    assert named(made([], seed)) == []


@pytest.mark.parametrize("seed", range(2))
def test_a_coupling_is_found_in_the_training_data(seed: int) -> None:
    found = made([coupled], seed)
    assert named(found) == [("transmission_coupling", 2, 3)]
    (added,) = found.model.effects
    check(added, COUPLING)
    assert added.parameters["ratio"].value == -1.0
    assert any("always there" in note for note in found.notes)
    assert max(found.held_out.moving["nrmse"]) < 0.05


def test_a_spring_is_found_in_the_training_data() -> None:
    found = made([sprung])
    assert named(found) == [("joint_spring", 2, None)]
    check(found.model.effects[0], SPRING)


def test_the_energies_find_it_too() -> None:
    assert named(made([coupled], library="lagrangian")) == [("transmission_coupling", 2, 3)]


def rippled(motion: Motion) -> Array:
    """A hundred teeth: beyond the low-pass as soon as the joint turns with 0.6 rad/s."""
    return np.outer(0.3 * np.sin(100 * motion.q[:, 2] + 0.7), [0, 0, 1])


def test_a_ripple_beyond_the_low_pass_is_found() -> None:
    found = made([rippled])
    assert named(found) == [("torque_ripple", 3, None)]
    parameters = found.model.effects[0].parameters
    assert parameters["order"].value == 100
    check(found.model.effects[0], {"amplitude": 0.3, "phase": 0.7})


def test_two_laws_are_both_found() -> None:
    found = made([sprung, coupled])
    assert sorted(named(found)) == [("joint_spring", 2, None), ("transmission_coupling", 2, 3)]


def test_a_nine_second_log_shows_a_coupling() -> None:
    assert named(made([coupled], seconds=9)) == [("transmission_coupling", 2, 3)]


def test_the_residual_alone_does_not_show_what_base_parameters_soak_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What a search of the residual would take the coupling for is a part of what it is."""
    from armloop.identification.reconstruction import catalogue

    whole = made([coupled]).held_out.moving["nrmse"]
    monkeypatch.setattr(catalogue, "permanent", lambda arm: [])
    without = made([coupled])
    assert named(without) == []
    assert max(without.held_out.moving["nrmse"]) > 3 * max(whole)


def test_the_model_with_a_law_is_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is saved, read, predicts, drives; the terminal and the file name what was always there."""
    path, out = tmp_path / "run.csv", tmp_path / "model.json"
    write_log(path, run([coupled]))
    command = ["reconstruct", str(path), "--arm", "three_axis", "--library", "rigid-body", "--out", str(out)]
    assert main(command) == 0
    assert (
        "always there: a motor turns with the difference of the speeds of joints 2 and 3"
        in capsys.readouterr().out
    )
    data = json.loads(out.read_text())
    assert [(e["effect"], e["joint"], e["other_joint"], e["when"]) for e in data["effects"]] == [
        ("transmission_coupling", 2, 3, "always")
    ]
    model = load_model(out)
    assert model.effects[0].when == "always"
    motion = fourier_motion(2, 100, 7)
    bare = replace(model, effects=())
    np.testing.assert_allclose(
        (model.predict(motion) - bare.predict(motion))[100],
        model.effects[0].torque(model.context(motion))[100],
    )
    q, v, vdot = motion.q[100], motion.v[100], motion.vdot[100]
    extra = model.feedforward(q, v, vdot) - bare.feedforward(q, v, vdot)
    np.testing.assert_allclose(
        extra, model.effects[0].torque(model.context(motion))[100], rtol=1e-9, atol=1e-9
    )
