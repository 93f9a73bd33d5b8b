"""Whole runs, start to end: what ties the simulated arm, the reconstruction and the diagnosis together."""

from armloop.loop.collecting import collect_logs
from armloop.loop.pickup import run_pickup_scenario
from armloop.loop.run import LOOP_FILES, LoopResult, run_loop
from armloop.loop.tracking import run_scenario
from armloop.loop.tuning import tune_scenario
from armloop.loop.wear import run_wear_scenario

__all__ = [
    "LOOP_FILES",
    "LoopResult",
    "collect_logs",
    "run_loop",
    "run_pickup_scenario",
    "run_scenario",
    "run_wear_scenario",
    "tune_scenario",
]
