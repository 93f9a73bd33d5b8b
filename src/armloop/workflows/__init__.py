"""Whole runs, start to end: what ties the simulated arm, the reconstruction and the diagnosis together."""

from armloop.workflows.collecting import collect_logs
from armloop.workflows.loop import LOOP_FILES, LoopResult, run_loop
from armloop.workflows.pickup import run_pickup_scenario
from armloop.workflows.tracking import log_files, run_scenario
from armloop.workflows.tuning import tune_scenario
from armloop.workflows.wear import run_wear_scenario

__all__ = [
    "LOOP_FILES",
    "LoopResult",
    "collect_logs",
    "log_files",
    "run_loop",
    "run_pickup_scenario",
    "run_scenario",
    "run_wear_scenario",
    "tune_scenario",
]
