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

#: Former name to present name; a package stands for all in it that has no line of its own. docs/moved.md shows it.
MOVED = {
    "armloop.arm": "armloop.robot.arm",
    "armloop.blocks": "armloop.data.blocks",
    "armloop.components": "armloop.model.components",
    "armloop.conditions": "armloop.data.regimes",
    "armloop.conditions.study": "armloop_paper.sorting_study",
    "armloop.design": "armloop.experiment.design",
    "armloop.diagnosis.apart": "armloop.diagnosis.isolability",
    "armloop.diagnosis.closing": "armloop.diagnosis.compensation",
    "armloop.diagnosis.rivals": "armloop.diagnosis.confounded",
    "armloop.drake_systems": "armloop.drake",
    "armloop.drake_systems.adaptive_feedforward": "armloop.drake.control.adaptive_feedforward",
    "armloop.drake_systems.beyond_bodies": "armloop.drake.plant.beyond_bodies",
    "armloop.drake_systems.bounded_feedforward": "armloop.drake.control.bounded_feedforward",
    "armloop.drake_systems.bounded_program": "armloop.drake.control.bounded_program",
    "armloop.drake_systems.closed_loop": "armloop.drake.experiments.closed_loop",
    "armloop.drake_systems.collection": "armloop.drake.experiments.collection",
    "armloop.drake_systems.computed_torque": "armloop.drake.control.computed_torque",
    "armloop.drake_systems.config": "armloop.drake.plant.config",
    "armloop.drake_systems.controllers": "armloop.drake.control.controllers",
    "armloop.drake_systems.effect_system": "armloop.drake.plant.effect_system",
    "armloop.drake_systems.effects": "armloop.drake.plant.fault_injection",
    "armloop.drake_systems.exact": "armloop.drake.plant.exact",
    "armloop.drake_systems.feedforward": "armloop.drake.control.feedforward",
    "armloop.drake_systems.forward_dynamics": "armloop.drake.plant.forward_dynamics",
    "armloop.drake_systems.friction": "armloop.drake.plant.friction",
    "armloop.drake_systems.friction_system": "armloop.drake.plant.friction_system",
    "armloop.drake_systems.gain_design": "armloop.drake.tuning.gain_design",
    "armloop.drake_systems.implicit": "armloop.drake.plant.implicit",
    "armloop.drake_systems.joint_loads": "armloop.drake.plant.joint_loads",
    "armloop.drake_systems.live": "armloop.drake.view.live",
    "armloop.drake_systems.loop_analysis": "armloop.drake.tuning.loop_analysis",
    "armloop.drake_systems.metrics": "armloop.drake.experiments.metrics",
    "armloop.drake_systems.model_expressions": "armloop.drake.plant.model_expressions",
    "armloop.drake_systems.nearest_friction": "armloop.drake.plant.nearest_friction",
    "armloop.drake_systems.own_effects": "armloop.drake.plant.own_effects",
    "armloop.drake_systems.pickup": "armloop.drake.experiments.pickup",
    "armloop.drake_systems.pid": "armloop.drake.control.pid",
    "armloop.drake_systems.plant": "armloop.drake.plant.plant",
    "armloop.drake_systems.rate_limiter": "armloop.drake.control.rate_limiter",
    "armloop.drake_systems.reference": "armloop.drake.control.reference",
    "armloop.drake_systems.replay": "armloop.drake.view.replay",
    "armloop.drake_systems.residual_monitor": "armloop.drake.control.residual_monitor",
    "armloop.drake_systems.scenario_data": "armloop.schemas.scenarios",
    "armloop.drake_systems.scenario_files": "armloop.drake.experiments.scenario_files",
    "armloop.drake_systems.scenario_references": "armloop.drake.experiments.scenario_references",
    "armloop.drake_systems.scenario_schema": "armloop.schemas.published",
    "armloop.drake_systems.scenario_types": "armloop.drake.control.scenario_types",
    "armloop.drake_systems.scenarios": "armloop.drake.experiments.scenarios",
    "armloop.drake_systems.scene": "armloop.drake.view.scene",
    "armloop.drake_systems.speed_mode": "armloop.drake.experiments.speed_mode",
    "armloop.drake_systems.step_check": "armloop.drake.tuning.step_check",
    "armloop.drake_systems.sticking": "armloop.drake.plant.sticking",
    "armloop.drake_systems.tracking": "armloop.drake.experiments.tracking",
    "armloop.drake_systems.tuned_loop": "armloop.drake.tuning.tuned_loop",
    "armloop.drake_systems.watched_run": "armloop.drake.experiments.watched_run",
    "armloop.drake_systems.wear": "armloop.drake.experiments.wear",
    "armloop.effects": "armloop.laws.effects",
    "armloop.errors": "armloop.util.errors",
    "armloop.excitation": "armloop.experiment.excitation",
    "armloop.export.consistent": "armloop.dynamics.consistent",
    "armloop.export.rereading": "armloop.export.round_trip",
    "armloop.export.said": "armloop.export.expressible",
    "armloop.files": "armloop.util.files",
    "armloop.functions": "armloop.util.functions",
    "armloop.goodness": "armloop.identification.goodness",
    "armloop.keeping": "armloop.util.checkpoints",
    "armloop.kinematics": "armloop.robot.kinematics",
    "armloop.library": "armloop.features",
    "armloop.library.friction": "armloop.laws.friction",
    "armloop.library.hysteresis": "armloop.laws.hysteresis",
    "armloop.library.stribeck": "armloop_paper.stribeck",
    "armloop.log": "armloop.data.log",
    "armloop.loop": "armloop.workflows",
    "armloop.loop.run": "armloop.workflows.loop",
    "armloop.motion": "armloop.data.motion",
    "armloop.newton_euler": "armloop.robot.newton_euler",
    "armloop.outputs": "armloop.util.outputs",
    "armloop.pieces": "armloop.data.pieces",
    "armloop.plausibility": "armloop.data.plausibility",
    "armloop.pointwise": "armloop.model.pointwise",
    "armloop.progress": "armloop.util.progress",
    "armloop.quiet": "armloop.util.quiet",
    "armloop.reading": "armloop.util.reading",
    "armloop.reconstruction": "armloop.identification.reconstruction",
    "armloop.reconstruction.apart": "armloop.identification.reconstruction.block_length",
    "armloop.reconstruction.friction_ladder": "armloop.identification.reconstruction.friction_selection",
    "armloop.reconstruction.sorter": "armloop.identification.reconstruction.nearest_regime",
    "armloop.reconstruction.unattenuated": "armloop.identification.reconstruction.attenuation",
    "armloop.registry": "armloop.util.registry",
    "armloop.regression.refined": "armloop_paper.refined",
    "armloop.reports.plots.reproduction": "armloop_paper.plots",
    "armloop.reports.reproduction_report": "armloop_paper.report",
    "armloop.reproduction": "armloop_paper",
    "armloop.resources": "armloop.util.resources",
    "armloop.sampling": "armloop.experiment.sampling",
    "armloop.scoring": "armloop.identification.scoring",
    "armloop.signals": "armloop.data.signals",
    "armloop.tables": "armloop.data.tables",
    "armloop.uncertainty": "armloop.identification.uncertainty",
    "armloop.uncertainty.coverage": "armloop_paper.coverage",
    "armloop.uncertainty.simulated": "armloop_paper.simulated",
    "armloop.urdf": "armloop.robot.urdf",
    "armloop.validation": "armloop.identification.validation",
    "armloop.voices": "armloop.util.doubts",
    "armloop.wave_table": "armloop.model.wave_table",
    "armloop.workers": "armloop.util.workers",
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
