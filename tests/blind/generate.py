"""Generating blind cases: an arm, its baseline logs and its runs into one folder, what is hidden into another."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from math import cos
from pathlib import Path
from typing import Any

from arms import random_arm
from hidden import Run, draw

from armloop.data.log import write_log
from armloop.drake.experiments.collection import CollectionPlan, collect, measure_run
from armloop.drake.plant.config import PlantConfig
from armloop.drake.plant.friction import JointFriction
from armloop.experiment.excitation import MotionRanges, fourier_reference
from armloop.robot.arm import load_arm

DURATION = 50.0


def generate(seed: int, cases: Iterable[int], plan: CollectionPlan, logs: Path, answers: Path) -> None:
    """Write ``logs/arm_SEED/{arm.urdf,baseline_*.csv,run_*.csv}`` and ``answers/arm_SEED_run_*.json`` of these runs."""
    drawn = random_arm(seed)
    folder = logs / f"arm_{seed}"
    folder.mkdir(parents=True)
    answers.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(drawn.urdf, encoding="utf-8")
    arm = load_arm(folder / "arm.urdf")
    friction = [JointFriction(**f) for f in drawn.friction]
    ranges = MotionRanges(**drawn.ranges)
    config = PlantConfig(tuple(friction), ranges)
    for name, log in collect(arm, config, plan, seed).items():
        write_log(folder / f"baseline_{name}.csv", log)
    for case in cases:
        number = 1000 * seed + case
        reference = fourier_reference(ranges, DURATION, number, harmonics=5)
        hidden = draw(Run.of(arm, friction, reference), number)
        log = measure_run(
            arm, config, number, effects=hidden.effects, reference=reference, law=_law(arm.n, hidden.extra)
        )
        write_log(folder / f"run_{case}.csv", log)
        answer = {**asdict(hidden), "effects": [_plain(asdict(e)) for e in hidden.effects]}
        (answers / f"arm_{seed}_run_{case}.json").write_text(json.dumps(answer), encoding="utf-8")


def _plain(effect: dict[str, Any]) -> dict[str, Any]:
    parameters = {
        key: [float(x) for x in value] if hasattr(value, "__len__") else float(value)
        for key, value in effect["parameters"].items()
    }
    return {**effect, "parameters": parameters}


def _law(n: int, extra: dict[str, Any]) -> Any:
    if not extra:
        return None
    joint, a, wave, of, speed, power = (extra[k] for k in ("joint", "a", "wave", "of", "speed", "power"))

    def law(q: list[float], v: list[float]) -> list[float]:
        tau = [0.0] * n
        tau[joint] = a * cos(wave * q[of]) * v[speed] ** power
        return tau

    return law
