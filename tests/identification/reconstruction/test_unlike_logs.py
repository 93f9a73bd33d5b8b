"""Logs of one arm in two states are told to be that: one model does not hold for both, though one of each does."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import fourier_motion, friction, rigid_torque, three_axis
from synthetic import measured as recorded

from armloop.data.log import MotionLog, read_log
from armloop.identification.reconstruction import unlike_logs
from armloop.identification.reconstruction.plain_fits import PlainFits
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.errors import InputWarning

Array = NDArray[np.float64]
LOAD = {"tool": 1.0, "trinket": 0.03}


def log(
    name: str, seed: int, mass: float = 0.0, off: int | None = None, noise: float = 0.01, rubs: float = 1.0
) -> MotionLog:
    """A run of an arm that carries a mass at its tool, or one of whose drives is off and another hand moves it."""
    arm, motion = three_axis(), fourier_motion(30, 100, seed)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + rubs * friction(motion.v)
    carried = np.zeros_like(nominal_parameters(arm))
    carried[-10], carried[-10 + 1] = mass, 0.3 * mass
    tau = tau + regressor(arm, motion.q, motion.v, motion.vdot) @ carried
    if off is not None:
        tau[:, off] = 0.0
    return recorded(motion, tau, seed, noise, name)


def found(*logs: MotionLog) -> str:
    arm = three_axis()
    whole = PlainFits.of(logs, arm, 8.5)
    assert whole is not None
    return unlike_logs.unlike(whole, {one.name: [one] for one in logs}, arm, 8.5)


@pytest.mark.parametrize("seed", range(3))
def test_a_log_with_a_tool_beside_others_without_is_named(seed: int) -> None:
    bare = [log(f"bare {k}", 10 * seed + k) for k in range(2)]
    said = found(*bare, log("with tool", 10 * seed + 2, LOAD["tool"]))
    assert (
        said.startswith("the arm was not the same in all logs: links that fit all leave ")
        and "with tool" in said
    )
    assert found(*bare) == ""
    assert found(*bare, log("with trinket", 10 * seed + 2, LOAD["trinket"])) == ""
    assert found(bare[0]) == ""


def test_what_is_exact_but_for_round_off_is_not_unlike() -> None:
    logs = [log(f"exact {k}", k, noise=0.0, rubs=0.0) for k in range(2)]
    own = PlainFits.of(logs[:1], three_axis(), 8.5)
    assert own is not None
    theta = unlike_logs._links_of_all([own], own)
    usual = own.table.sizes(own.table.tau, own.table.moving)
    # ten thousandths of the torque that a sensor's last digit would hide
    _, alone, together = unlike_logs._left(own, theta * (1 + 1e-4), usual)
    assert (together < 3 * alone).all() and found(*logs) == ""


def test_each_half_is_judged_by_a_model_of_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    own = PlainFits.of([log("run", 0)], three_axis(), 8.5)
    assert own is not None
    fitted: list[NDArray[np.bool_]] = []
    judged: list[NDArray[np.bool_]] = []
    solved, sizes = PlainFits.solved, type(own.table).sizes

    def recorded_solved(self: PlainFits, tau: Array, rows: NDArray[np.bool_]) -> tuple[Array, Array]:
        answer = solved(self, tau, rows)
        fitted.append(rows)
        judged.clear()
        return answer

    def recorded_sizes(self: object, values: Array, rows: NDArray[np.bool_]) -> Array:
        judged.append(rows)
        if len(fitted) and len(judged) == 1 and len(pairs) < len(fitted):
            pairs.append((fitted[-1], rows))
        return np.asarray(sizes(self, values, rows))

    pairs: list[tuple[NDArray[np.bool_], NDArray[np.bool_]]] = []
    monkeypatch.setattr(PlainFits, "solved", recorded_solved)
    monkeypatch.setattr(type(own.table), "sizes", recorded_sizes)
    unlike_logs._left(own, np.zeros(own.base.count), np.zeros(3))
    assert len(pairs) >= 2 and not any((rows & others).any() for rows, others in pairs[:2])


def test_logs_of_one_arm_at_other_speeds_are_alike() -> None:
    """A slow log of friction that falls with the speed, as the paper's static one, and a fast one."""
    logs = []
    for name, pace in (("slow", 0.05), ("fast", 1.0)):
        motion = fourier_motion(20 * max(pace, 0.3), 100 / pace, 5)
        motion = replace(motion, v=pace * motion.v, vdot=pace**2 * motion.vdot)
        tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
        tau += 3.0 * np.exp(-((motion.v / 0.1) ** 2)) * np.sign(motion.v)
        time = np.arange(motion.samples) * 0.01
        logs.append(recorded(replace(motion, time=time), tau, 5, name=name))
    assert found(*logs) == ""


def test_a_drive_that_is_off_in_a_log_says_nothing_there() -> None:
    """Its torque is nothing, of which what is left is any multiple."""
    arm, logs = three_axis(), [log("driven", 0), log("led", 1, off=2)]
    whole, led = PlainFits.of(logs, arm, 8.5), PlainFits.of(logs[1:], arm, 8.5)
    assert whole is not None and led is not None
    theta = unlike_logs._links_of_all([led], whole)
    usual = whole.table.sizes(whole.table.tau, whole.table.moving)
    joints, alone, together = unlike_logs._left(led, theta, usual)
    assert joints.tolist() == [0, 1] and len(alone) == len(together) == 2


def test_it_is_said_where_torques_are_checked() -> None:
    logs = [log("bare", 0), log("with tool", 1, LOAD["tool"])]
    with pytest.warns(InputWarning, match="bare, with tool: the arm was not the same in all logs"):
        check_torques(logs, three_axis(), 8.5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_torques([log("bare", 0), log("other", 1)], three_axis(), 8.5)


@pytest.mark.measured
def test_a_measured_arm_with_a_load_in_one_of_its_logs(measured: Path) -> None:
    folder, gains = measured / "ur10e", [11.75, 11.98, 9.83, 10.75, 10.55, 10.9]
    arm = load_arm(folder / "ur10e.urdf")
    names = ("noload_20_02_06-20sec_10harm", "noload_20_02_12-40sec_12harm", "load_20_01_31-load")
    *bare, loaded = (read_log(folder / f"{name}.csv", drive_gains=gains) for name in names)

    def said(*logs: MotionLog) -> str:
        whole = PlainFits.of(logs, arm, 8.5)
        assert whole is not None
        return unlike_logs.unlike(whole, {one.name: [one] for one in logs}, arm, 8.5)

    assert said(*bare) == ""
    assert said(*bare, loaded).startswith("the arm was not the same in all logs")
