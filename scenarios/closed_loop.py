"""Closed-loop tracking as a Drake diagram to copy: PID alone, and PID with a model as feedforward.

    python scenarios/closed_loop.py [MODEL.json] [--seconds 4]

Prints the mean absolute tracking error of each joint, in degrees. Without a file the model is the simulated arm's own,
which no reconstruction can beat. `armloop track three_axis_tracking` compares the controllers of a scenario, with reports.
"""

import argparse

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from armloop.drake import FeedforwardModel, add_arm_with_controller
from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.plant.exact import exact_model
from armloop.model import load_model
from armloop.util.errors import InputError

SCENARIO = load_tracking("three_axis_tracking")
PERIOD = 0.004  # s, of the log


def tracking_error(model: FeedforwardModel | None, seconds: float) -> np.ndarray:
    """Mean absolute tracking error (n,) of the scenario's arm on its reference, rad."""
    builder = DiagramBuilder()
    arm = add_arm_with_controller(builder, SCENARIO.plant, SCENARIO.gains, SCENARIO.reference, model)
    log = LogVectorOutput(arm.plant.GetOutputPort("state"), builder, PERIOD)
    simulator = Simulator(builder.Build())
    arm.start_on_reference(simulator.get_mutable_context())
    simulator.AdvanceTo(seconds)
    recorded = log.FindLog(simulator.get_context())
    wanted, _, _ = SCENARIO.reference.evaluate(recorded.sample_times())
    return np.abs(recorded.data().T[:, : wanted.shape[1]] - wanted).mean(axis=0)


def main(words: list[str] | None = None) -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("model", nargs="?", metavar="MODEL.json")
    parser.add_argument("--seconds", type=float, default=4.0, help="of the reference (%(default)s)")
    options = parser.parse_args(words)
    plant, longest = SCENARIO.plant, SCENARIO.reference.duration
    if not PERIOD <= options.seconds <= longest:
        parser.error(f"--seconds {options.seconds:g}: give {PERIOD:g} to {longest:g}, what the reference has")
    try:
        model = (
            load_model(options.model, plant.arm)
            if options.model
            else exact_model(plant.arm, plant.config.friction)
        )
    except InputError as error:
        parser.error(str(error))
    for name, used in (("PID", None), ("PID with the model", model)):
        error = np.rad2deg(tracking_error(used, options.seconds))
        print(f"{name:20s}", *(f"{joint:8.4f}°" for joint in error))


if __name__ == "__main__":
    main()
