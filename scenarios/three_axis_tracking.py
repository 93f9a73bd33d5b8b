"""Track the reference of Fig. 14 with PID, and with the simulated arm's exact model in Eqs. (35) and (36).

Run it with `python scenarios/three_axis_tracking.py`. `armloop track three_axis_tracking --model
model=MODEL.json` does the same with a reconstructed model.
"""

from armloop.drake_systems.exact import ExactModel
from armloop.drake_systems.scenarios import load_tracking
from armloop.drake_systems.tracking import run_tracking

if __name__ == "__main__":
    scenario = load_tracking("three_axis_tracking")
    model = ExactModel(scenario.plant.arm, scenario.plant.config.friction)
    for controller, result in run_tracking(scenario, {"model": model}).items():
        print(
            f"{controller:10s}",
            *(f"{eta:7.4f} {unit}" for eta, unit in zip(result.eta, result.unit, strict=True)),
        )
