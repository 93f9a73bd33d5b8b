"""Aliases of moved modules: importing one by its former name gives the same module and a warning.

``armloop`` asks :func:`find_spec` for what no other finder knows, so that nothing of this is loaded before it is needed.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import ModuleType

#: What keeps its name, by the former folder and the present one.
_BY_FOLDER = {
    ("armloop", "armloop.data"): "blocks log motion pieces plausibility signals tables",
    ("armloop", "armloop.experiment"): "design excitation sampling",
    ("armloop", "armloop.identification"): "goodness reconstruction scoring uncertainty validation",
    ("armloop", "armloop.model"): "components pointwise wave_table",
    ("armloop", "armloop.robot"): "arm kinematics newton_euler urdf",
    ("armloop", "armloop.util"): (
        "errors files functions outputs progress quiet reading registry resources workers"
    ),
    ("armloop.drake_systems", "armloop.drake.control"): (
        "adaptive_feedforward bounded_feedforward bounded_program computed_torque controllers feedforward "
        "pid rate_limiter reference residual_monitor scenario_types"
    ),
    ("armloop.drake_systems", "armloop.drake.experiments"): (
        "closed_loop collection metrics pickup scenario_files scenario_references scenarios speed_mode "
        "tracking watched_run wear"
    ),
    ("armloop.drake_systems", "armloop.drake.plant"): (
        "beyond_bodies config effect_system exact forward_dynamics friction friction_system implicit "
        "joint_loads model_expressions nearest_friction plant sticking"
    ),
    ("armloop.drake_systems", "armloop.drake.tuning"): "gain_design loop_analysis step_check tuned_loop",
    ("armloop.drake_systems", "armloop.drake.view"): "live replay scene",
    ("armloop.library", "armloop.laws"): "friction hysteresis",
    ("armloop.uncertainty", "armloop_paper"): "coverage simulated",
}
#: Former name to present name; a package stands for all in it that has no line of its own. docs/moved.md shows it.
MOVED = {
    f"{former}.{name}": f"{present}.{name}"
    for (former, present), names in _BY_FOLDER.items()
    for name in names.split()
} | {
    "armloop.conditions": "armloop.data.regimes",
    "armloop.conditions.study": "armloop_paper.sorting_study",
    "armloop.diagnosis.alternatives": "armloop.diagnosis.diagnose",
    "armloop.diagnosis.apart": "armloop.diagnosis.isolability",
    "armloop.diagnosis.closing": "armloop.diagnosis.compensation",
    "armloop.diagnosis.remedies": "armloop.laws.effects.base",
    "armloop.diagnosis.rivals": "armloop.diagnosis.confounded",
    "armloop.drake.plant.own_effects": "armloop.drake.plant.fault_injection",
    "armloop.drake_systems": "armloop.drake",
    "armloop.drake_systems.effects": "armloop.drake.plant.fault_injection",
    "armloop.drake_systems.own_effects": "armloop.drake.plant.fault_injection",
    "armloop.drake_systems.scenario_data": "armloop.schemas.scenarios",
    "armloop.drake_systems.scenario_schema": "armloop.schemas.published",
    "armloop.dynamics.rigid": "armloop.dynamics.arrays",
    "armloop.effects": "armloop.laws.effects",
    "armloop.export.consistent": "armloop.dynamics.consistent",
    "armloop.export.rereading": "armloop.export.round_trip",
    "armloop.export.said": "armloop.export.expressible",
    "armloop.goodness.ranges": "armloop.identification.goodness.parts",
    "armloop.identification.goodness.ranges": "armloop.identification.goodness.parts",
    "armloop.identification.reconstruction.judged": "armloop.identification.reconstruction.reconstruct",
    "armloop.keeping": "armloop.util.checkpoints",
    "armloop.library": "armloop.features",
    "armloop.library.stribeck": "armloop_paper.stribeck",
    "armloop.loop": "armloop.workflows",
    "armloop.loop.run": "armloop.workflows.loop",
    "armloop.reconstruction.apart": "armloop.identification.reconstruction.block_length",
    "armloop.reconstruction.friction_ladder": "armloop.identification.reconstruction.friction_selection",
    "armloop.reconstruction.judged": "armloop.identification.reconstruction.reconstruct",
    "armloop.reconstruction.sorter": "armloop.identification.reconstruction.nearest_regime",
    "armloop.reconstruction.unattenuated": "armloop.identification.reconstruction.attenuation",
    "armloop.regression.refined": "armloop_paper.refined",
    "armloop.reports.plots.reproduction": "armloop_paper.plots",
    "armloop.reports.reproduction_report": "armloop_paper.report",
    "armloop.reproduction": "armloop_paper",
    "armloop.voices": "armloop.util.doubts",
}


def present_name(name: str) -> str | None:
    """The present name of a module that has moved; None if the name is no former one."""
    head, tail = name, ""
    while head:
        if head in MOVED:
            return MOVED[head] + tail
        head, dot, last = head.rpartition(".")
        tail = f"{dot}{last}{tail}"
    return None


def find_spec(name: str, path: object = None, target: object = None) -> ModuleSpec | None:
    """A spec that loads the module of the present name, for a former one."""
    if _Finder not in sys.meta_path:
        # first from now on: by its path a former package would load its parts a second time
        sys.meta_path.insert(0, _Finder)
    present = present_name(name)
    return None if present is None else ModuleSpec(name, _Loader(present))


class _Finder:
    find_spec = staticmethod(find_spec)


class _Loader(Loader):
    """Puts the module of the present name in place of the former one."""

    def __init__(self, present: str) -> None:
        self._present = present

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        warnings.warn(
            f"{spec.name} is now {self._present}; the former name will go", DeprecationWarning, stacklevel=2
        )
        module = import_module(self._present)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._spec  # which the import has taken for a new module's
