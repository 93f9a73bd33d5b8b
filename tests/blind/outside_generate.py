"""Runs of an arm from outside: a URDF, training logs and cases go into one folder, what is hidden into another."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from outside.mujoco_arms import random_arm, write_log
from outside.mujoco_run import Diverged
from outside.references import fourier_reference, mixed_reference, point_reference
from outside_cases import draw_case

#: What is hidden in one case after the other, and its size as a share of the joint's RMS torque.
KINDS = ("clean", "one", "event", "one", "two", "one", "unlisted", "one")
SIZES = (0.04, 0.08, 0.2)
#: The same of runs in which a load is picked up and put down.
LOADS = ("carried", "carried", "clean", "carried")
#: The same of runs in which a joint meets a spring on one side.
STOPS = ("stop", "stop", "clean", "stop")
#: The same of runs in which a spring pulls between two joints, or a cable at a link.
TENDONS = ("tendon", "tendon", "clean", "tendon")
#: So often another effect is drawn where one throws the arm off its path.
_ATTEMPTS = 5


def generate_outside(
    seed: int,
    cases: int,
    logs: Path,
    answers: Path,
    numbers: Sequence[int] = (2, 3, 3, 4),
    seconds: float = 30.0,
    points: bool = False,
    loads: bool = False,
    stops: bool = False,
    tendons: bool = False,
) -> None:
    """Write one arm's cases; joints (one of the numbers), sample rate, noise and controller are drawn from the seed, too.

    Args:
        points: the runs, not the training logs, go from point to point and dwell there.
        loads: what is hidden is a load that is carried in parts of a run.
        stops: what is hidden is a spring on one side of a position.
        tendons: what is hidden is a spring between two joints, or a cable from a fixed point to a link.
    """
    rng = np.random.default_rng([seed, 0x0575])
    joints = int(rng.choice(numbers))
    arm = random_arm(seed, joints, sliding=rng.random() < 0.15)
    how = {
        "rate": float(rng.choice([100, 200, 250, 500, 1000])),
        "controller": str(rng.choice(["computed_torque", "pd"])),
        "noise": float(rng.choice([0.005, 0.01, 0.02])),
        "encoder_bits": int(rng.choice([13, 15, 17, 20])),
    }
    name = f"outside_{seed}"
    folder = logs / name
    folder.mkdir(parents=True, exist_ok=True)
    answers.mkdir(parents=True, exist_ok=True)
    arm.write_urdf(folder / "arm.urdf", mass_error=0.1)
    training = (fourier_reference(arm, seed, 40.0), mixed_reference(arm, seed + 1, 40.0))
    for k, reference in enumerate(training):
        write_log(arm.simulate(reference, seed=1000 + k, **how), folder / f"baseline_{k + 1}.csv")
    for case in range(cases):
        kinds = LOADS if loads else STOPS if stops else TENDONS if tendons else KINDS
        kind, size = kinds[case % len(kinds)], SIZES[int(rng.integers(len(SIZES)))]
        speed = float(rng.uniform(0.6, 1.0))
        reference = (point_reference if points else fourier_reference)(
            arm, 1000 * seed + case, seconds, speed
        )
        for attempt in range(_ATTEMPTS):
            try:
                hidden = draw_case(arm, reference, 1000 * seed + case + 100 * attempt, kind, size)
                log = arm.simulate(reference, hidden.effects, seed=case, **how)
                break
            except Diverged:
                # An effect that the controller cannot hold leaves no log: another one is drawn.
                if attempt == _ATTEMPTS - 1:
                    raise
        write_log(log, folder / f"run_{case}.csv")
        (answers / f"{name}_run_{case}.json").write_text(
            json.dumps({**hidden.sealed(), "seconds": seconds}, indent=1), encoding="utf-8"
        )
