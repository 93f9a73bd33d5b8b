"""Logs from a simulated arm, by the name of a plan; the segments are shared out over the machine's cores."""

from __future__ import annotations

from armloop.data.log import MotionLog
from armloop.drake.experiments.collection import collect
from armloop.drake.experiments.scenarios import load_plan, plan_names, plant_for
from armloop.experiment.sampling import inverse_dynamics_samples
from armloop.robot.arm import Arm
from armloop.util.errors import InputError, ScenarioError
from armloop.util.progress import Progress

SIMULATION = "simulation"
#: Samples per step in Sects. 4.1 (four joints) and 4.2 (three joints) of the paper.
_COUNTS = {4: (2000, 4000, 4000), 3: (1000, 10000, 10000)}


def collect_logs(arm: str | Arm, plan: str, seed: int, progress: Progress) -> dict[str, MotionLog]:
    """Collect the logs of a plan from an arm.

    Args:
        arm: built-in name, path of a URDF, or an arm that is loaded.
        plan: a plan of ``scenarios/collection.yaml``, or ``"simulation"``: friction-free inverse dynamics
            at random states, with the paper's numbers of samples.

    Raises:
        InputError: the arm or the plan is unknown, or the seed is negative.
    """
    if seed < 0:
        raise InputError(f"--seed {seed}: give a whole number from 0")
    if plan not in (SIMULATION, *plan_names()):
        raise ScenarioError(
            f"--plan {plan}: there is no such plan; there are: {', '.join([*plan_names(), SIMULATION])}"
        )
    plant = plant_for(arm, () if plan == SIMULATION else None)  # it has no friction
    if plan == SIMULATION:
        counts = _COUNTS.get(plant.arm.n, (2000, 10000, 10000))
        return inverse_dynamics_samples(plant.arm, plant.config.ranges, counts, seed)
    shown = -1

    def report(what: str, done: float) -> None:
        nonlocal shown
        if int(10 * done) > shown:
            shown = int(10 * done)
            progress(f"collecting {what}: {done:.0%}")

    return collect(plant.arm, plant.config, load_plan(plan), seed, report)
