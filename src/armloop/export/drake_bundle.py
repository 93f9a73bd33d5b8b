"""A folder for Drake: the arm as URDF, the model, and a program of ten lines that has all of it."""

from __future__ import annotations

import contextlib
import io
import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.drake.plant.beyond_bodies import presliding_elements
from armloop.dynamics import ModelEquations
from armloop.export.exported import Exported, rms_of, whole_torque
from armloop.export.expressible import Said, friction_torques, random_motion, said
from armloop.export.robot_xml import urdf_text
from armloop.export.round_trip import drake_torque
from armloop.model import ReconstructedModel
from armloop.robot.newton_euler import mass_matrix
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.files import write_text
from armloop.util.functions import MATH
from armloop.util.quiet import quiet

_STEP = 1e-3
_SMALLEST_SMOOTHING = 0.01
_POSTURES = 100
_PROGRAM = '''\
"""The arm as a Drake plant with all that armloop's model knows of it; SI units. Connect drives to its actuation port."""

from pathlib import Path

from pydrake.all import AddMultibodyPlantSceneGraph, DiagramBuilder, Parser, Simulator

from armloop.drake import add_joint_forces, friction_systems
from armloop.model import load_model

here, builder = Path(__file__).parent, DiagramBuilder()
plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step={step!r})
Parser(plant).AddModels(str(here / "arm.urdf"))
plant.Finalize()
model = load_model(here / "model.json")
systems = add_joint_forces(builder, plant, friction_systems(model, smoothing={smoothing!r}, period={step!r}))
simulator = Simulator(builder.Build())
simulator.AdvanceTo(0.1)
print("q after 0.1 s without drives:", plant.GetPositions(plant.GetMyContextFromRoot(simulator.get_context())))
'''


def as_drake(model: ReconstructedModel, folder: Path, motion: Motion) -> Exported:
    """Write ``arm.urdf``, ``model.json`` and ``simulate.py``, run the program, and compare the torques.

    Raises:
        InputError: the place cannot be written to, or the program does not run.
    """
    what = said(model, nearest_friction=False)
    smoothing = _smoothing(model, what)
    files = [folder / name for name in ("arm.urdf", "model.json", "simulate.py")]
    write_text(files[0], urdf_text(what))
    model.save(files[1])
    write_text(files[2], _PROGRAM.format(step=_STEP, smoothing=smoothing))
    try:
        with contextlib.redirect_stdout(io.StringIO()), quiet("drake"):
            program = runpy.run_path(str(files[2]))
    except RuntimeError as error:
        raise InputError(f"{files[2]}: does not run in Drake: {' '.join(str(error).split())}") from error
    names = [joint.name for joint in model.arm.joints]
    tau = drake_torque(files[0], names, motion.q, motion.v, motion.vdot)
    tau -= _forces(program, presliding_elements(model), motion.q, motion.v)
    whole = whole_torque(model, motion)
    expected = _smoothed(model, what, motion, smoothing)
    missing = [line for line in what.missing if line.startswith(("terms that", "no bodies"))]
    kinds = {t.kind for joint in model.friction.terms for t in joint}
    if "load_hysteresis" in kinds:
        missing.append("memory of friction that grows with the load: as if fully slid")
    if any(kind.startswith("load") for kind in kinds):
        missing.append("friction that grows with the load takes the load without acceleration")
    if any(a.effect.name == "transmission_coupling" for a in model.effects):
        missing.append("the inertia of a motor that two joints share")
    missing += [f"{a.effect.label()}: a fault of the record" for a in model.effects if a.effect.sensor]
    notes = [
        f"dry friction sets in as tanh(v/{smoothing:g}): stable at {_STEP:g} s; armloop's ArmPlant really sticks"
    ]
    return Exported(
        "drake",
        files,
        "Drake",
        rms_of(whole),
        np.abs(tau - expected).max(axis=0),
        np.abs(tau - whole).max(axis=0),
        missing,
        notes + what.notes,
    )


def _forces(program: dict[str, Any], elements: list[Any], q: Array, v: Array) -> Array:
    """(N, n) forces of the program's systems at states in which every element has slid."""
    tau = np.zeros_like(q)
    for index, system in enumerate(program["systems"]):
        context = system.CreateDefaultContext()
        for k in range(len(q)):
            system.GetInputPort("state").FixValue(context, np.concatenate([q[k], v[k]]))
            if index:
                stretch = [e.width * np.sign(v[k, e.joint - 1]) for e in elements]
                context.SetDiscreteState(np.concatenate([q[k], stretch]))
            tau[k] += system.GetOutputPort("force").Eval(context)
    return tau


def _smoothed(model: ReconstructedModel, what: Said, motion: Motion, smoothing: float) -> Array:
    """(N, n) torques of the bodies written and the rest of the model, dry friction smoothed but for what has slid.

    The load that friction grows with is taken without acceleration.
    """
    whole = ModelEquations(model, MATH, smoothing=smoothing)
    bodies = tuple(a for a in model.effects if a.effect.name in ("payload", "rotor_inertia"))
    rigid = ModelEquations(replace(model, effects=bodies), MATH)
    elements = presliding_elements(model)
    rows = what.torque(motion.q, motion.v, motion.vdot, frozenset())
    still = [0.0] * model.arm.n
    for k, (q, v) in enumerate(zip(motion.q.tolist(), motion.v.tolist(), strict=True)):
        rows[k] += whole.friction(v, whole.load(q, v, still), 0.0, q)
        rows[k] += np.subtract(whole.rigid(q, v, still), rigid.rigid(q, v, still))
        for e in elements:
            x = v[e.joint - 1]
            rows[k, e.joint - 1] += e.level * (MATH.sign(x) - MATH.tanh(x / smoothing))
    return rows


def _smoothing(model: ReconstructedModel, what: Said) -> float:
    """A speed over which dry friction may change sign without chatter: h f (M^-1)_ii, at least; two digits."""
    M = mass_matrix(model.arm, what.links)
    q = random_motion(model, _POSTURES, seed=5).q
    inverse = [np.diag(np.linalg.inv(np.array(M(row)) + np.diag(what.rotors))) for row in q]
    level = np.abs(friction_torques(model)[1]).max(axis=0)
    needed = float((_STEP * level * np.max(inverse, axis=0)).max())
    return float(f"{max(needed, _SMALLEST_SMOOTHING):.2g}")
