"""How much less data an optimised reference needs than random ones for the same coefficient error.

First by simulated regressions in numpy: torques of the library itself with white noise, many draws. Then once in
closed loop: the simulated arm with sticking friction, encoders and torque noise follows both kinds of reference,
and `reconstruct --library rigid-body` estimates the base parameters, whose true values are the URDF's.
"""

from __future__ import annotations

import time

import numpy as np

from armloop.data.log import MotionLog
from armloop.drake.experiments.collection import measure_run
from armloop.drake.experiments.scenarios import Plant, load_plant
from armloop.experiment.design import Excitation, Settings, amount_needed, excite, random_references
from armloop.experiment.excitation import Reference
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import reconstruct
from armloop.model.components import RigidBody
from armloop.reports.tables import table
from armloop.reports.words import number
from armloop.robot.kinematics import nominal_parameters

ARMS = ("three_axis", "scara")
CRITERIA = ("variance", "logdet", "condition")
#: Closed loop: noise seeds of the optimised run; sequences of random references, and how many each.
NOISES, SEQUENCES, LONGEST = 4, 4, 5


def median_and_spread(values: list[float] | np.ndarray) -> str:
    """`median (least to greatest)`."""
    low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
    return f"{number(middle)} ({number(low)} to {number(high)})"


def simulated() -> dict[str, Excitation]:
    """Print condition numbers and data ratios for every arm, library and criterion; return the rigid-body designs."""
    rows, kept = [], {}
    for name in ARMS:
        plant = load_plant(name)
        for library in ("rigid-body", "double-feature-set"):
            for criterion in CRITERIA if library == "rigid-body" else CRITERIA[:1]:
                start = time.perf_counter()
                made = excite(
                    plant.arm, plant.config.ranges, Settings(library=library, criterion=criterion, starts=2)
                )
                seconds = time.perf_counter() - start
                ratio = made.compare().to_dict()
                random = made.to_dict()["random"]
                rows.append(
                    [
                        name,
                        library,
                        criterion,
                        made.regression.count,
                        made.measure.condition,
                        random["condition"]["median"],
                        made.measure.logdet,
                        random["logdet"]["median"],
                        ratio["median"],
                        f"{seconds:.0f} s",
                    ]
                )
                if (library, criterion) == ("rigid-body", "variance"):
                    kept[name] = made
    headers = [
        "arm",
        "library",
        "criterion",
        "p",
        "condition",
        "random",
        "logdet",
        "random",
        "data ratio",
        "time",
    ]
    print(
        table(headers, rows, "Optimised against the median of 20 random references, same limits and duration")
    )
    print(
        "data ratio: random trajectories, each a new one, for the coefficient error of one optimised trajectory\n"
    )
    return kept


def coefficient_error(plant: Plant, made: Excitation, logs: list[MotionLog]) -> float:
    """Root mean square error of the reconstructed base parameters, each in torque on typical motion, 1 % of effort."""
    arm = plant.arm
    base = BaseParameters.of_arm(arm, rotors=True)
    model = reconstruct(logs, arm, library="rigid-body").model
    body = next(part for part in model.components if isinstance(part, RigidBody))
    truth = base.from_full(np.concatenate([nominal_parameters(arm), np.zeros(arm.n)]))
    inertial = made.regression.kept < base.count
    error = (base.from_full(body.parameters) - truth)[made.regression.kept[inertial]]
    return float(np.sqrt(np.mean((error * made.regression.size[inertial]) ** 2)))


def measured(plant: Plant, reference: Reference, seed: int) -> MotionLog:
    """One run of the simulated arm."""
    return measure_run(plant.arm, plant.config, seed, reference=reference)


def closed_loop(name: str, made: Excitation) -> None:
    """Print the errors of optimised and random runs against the amount of data, and their ratio."""
    plant, period = load_plant(name), made.timing.period
    ours = [measured(plant, made.reference, seed) for seed in range(NOISES)]
    goal = [coefficient_error(plant, made, [log]) for log in ours]
    rows: list[list[object]] = [["optimised", f"{period:g} s", median_and_spread(goal)]]
    drawn = random_references(made.limits, period, SEQUENCES * LONGEST, seed=7)
    errors = np.empty((SEQUENCES, LONGEST))
    for k in range(SEQUENCES):
        logs = [
            measured(plant, reference, 100 * k + j)
            for j, reference in enumerate(drawn[k * LONGEST : (k + 1) * LONGEST])
        ]
        errors[k] = [coefficient_error(plant, made, logs[: j + 1]) for j in range(LONGEST)]
    rows += [["random", f"{period * (j + 1):g} s", median_and_spread(errors[:, j])] for j in range(LONGEST)]
    print(
        table(
            ["reference", "data", "coefficient error"],
            rows,
            f"{name} in closed loop, errors of base parameters",
        )
    )
    needs = sorted(amount_needed(row, float(np.median(goal))) for row in errors)
    each = ", ".join(number(need, 2) if np.isfinite(need) else f"more than {LONGEST}" for need in needs)
    print(
        f"for the optimised one's error, random references need {each} times as much data (each sequence)\n"
    )


def main() -> None:
    """Run both comparisons."""
    for name, made in simulated().items():
        closed_loop(name, made)


if __name__ == "__main__":
    main()
