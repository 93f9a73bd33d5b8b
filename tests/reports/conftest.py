"""One small run of the loop without a simulator, shared by all tests of the reports."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from exact_parts import as_it_was
from synthetic import (
    fourier_motion,
    friction,
    measured,
    rigid_torque,
    three_axis,
)

from armloop.data.log import MotionLog
from armloop.data.regimes import sort_samples
from armloop.data.signals import as_torque, preprocess
from armloop.diagnosis import diagnose
from armloop.drake.experiments.tracking import TrackingResult
from armloop.identification.reconstruction import Reconstruction, StepReport
from armloop.identification.scoring import score


@pytest.fixture(autouse=True, scope="module")
def _drawings(_no_drawings: Callable[..., str]) -> Iterator[None]:
    """Here pages are drawn as they are for users."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("armloop.reports.html.svg", _no_drawings)
        yield


SPRING = {"stiffness": 1.5, "rest": 0.3}


def spring(q: np.ndarray) -> np.ndarray:
    """A spring on joint 2."""
    return np.outer(SPRING["stiffness"] * (q[:, 1] - SPRING["rest"]), [0, 1, 0])


def run(name: str, seed: int, sprung: bool = False) -> MotionLog:
    motion = fourier_motion(30, 100, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau + spring(motion.q) * sprung, seed, name=name)


def tracked(controller: str, size: float) -> TrackingResult:
    """A controller that is off by a sine of ``size`` degrees."""
    motion = fourier_motion(40, 250, 3)
    error = np.deg2rad(size) * np.sin(np.outer(motion.time, [1.0, 1.3, 0.7]))
    scored = slice(5000, 10000)
    degrees = np.rad2deg(np.abs(error[scored]))
    return TrackingResult(
        controller,
        motion.time,
        motion.q,
        motion.q - error,
        np.zeros_like(motion.q),
        scored,
        degrees.mean(axis=0),
        np.sqrt((degrees**2).mean(axis=0)),
        degrees.max(axis=0),
        ("deg",) * 3,
    )


def reconstructed(log: MotionLog) -> Reconstruction:
    """The arm's own parameters as if a reconstruction had found them, scored on a log."""
    model = as_it_was()
    held_out = score(model, preprocess([log], model.conditioning))
    model = replace(model, baseline=held_out.moving)
    reports = [
        StepReport(
            step, [2, N2], 100, 80, [4, 5, 6], [700, 700, 700], [([1, N2], 0.2 / step), ([2, N2], 0.01)]
        )
        for step, N2 in ((1, 0), (2, 2), (3, 1))
    ]
    return Reconstruction(model, reports, held_out, [])


@pytest.fixture(scope="session")
def loop() -> SimpleNamespace:
    """A loop's result: measured, reconstructed, tracked, diagnosed."""
    logs = {"static": run("static", 1), "varying": run("varying", 2)}
    made = reconstructed(logs["varying"])
    diagnosis = diagnose(made.model, [run("again", 5, sprung=True)])
    sizes = {"pid": 1.8, "pid_step1": 0.9, "pid_step3": 0.02}
    return SimpleNamespace(
        seed=7,
        arm=three_axis(),
        logs=logs,
        clusters=sort_samples(as_torque(preprocess(list(logs.values()), made.model.conditioning)).motion),
        reconstruction=made,
        reference=made,
        tracking={name: tracked(name, size) for name, size in sizes.items()},
        diagnosis=diagnosis,
        undeclared={"effect": "joint_spring", "joint": 2, "parameters": SPRING},
        right=True,
        tracking_before=tracked("pid_step3", 0.4),
        tracking_after=tracked("pid_step3", 0.03),
        seconds={"collect": 1.5, "reconstruct": 2.25},
        notes=["a note with <angle> brackets"],
    )


@pytest.fixture(scope="session")
def clean(loop: SimpleNamespace) -> object:
    """The diagnosis of a run in which nothing changed."""
    return diagnose(loop.reconstruction.model, [run("clean", 6)])
