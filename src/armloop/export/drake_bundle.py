"""A folder for Drake: the arm as URDF, the model, and a program of ten lines that has all of it."""

from __future__ import annotations

import contextlib
import io
import runpy
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from armloop.data.motion import Motion
from armloop.drake.plant.beyond_bodies import explicit_part, presliding_elements
from armloop.dynamics import ModelEquations
from armloop.export.exported import NAMES, Exported, rms_of, whole_torque
from armloop.export.expressible import Said, random_motion, said
from armloop.export.robot_xml import urdf_text
from armloop.export.round_trip import drake_torque
from armloop.model import ReconstructedModel
from armloop.robot.newton_euler import mass_matrix
from armloop.util.arrays import Array
from armloop.util.errors import InputError
from armloop.util.files import strict, write_text
from armloop.util.functions import MATH
from armloop.util.quiet import quiet

_STEP = 1e-3
# rad/s (m/s): no smaller speed is worth a distinction, no larger one is called dry friction.
_SMALLEST_SMOOTHING, _LARGEST_SMOOTHING = 0.003, 10.0
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
    """Write arm, model and program, run it, and compare the torques; raises ``InputError`` where that cannot be done."""
    what = said(model, nearest_friction=False)
    smoothing = _smoothing(model, what)
    texts = {"arm.urdf": urdf_text(what), "simulate.py": _PROGRAM.format(step=_STEP, smoothing=smoothing)}
    names = model.arm.joint_names
    with tempfile.TemporaryDirectory() as place:  # what does not run is not written
        draft = Path(place)
        for name, text in texts.items():
            (draft / name).write_text(text, encoding="utf-8")
        (draft / "model.json").write_text(strict(model.to_dict()), encoding="utf-8")
        try:
            with contextlib.redirect_stdout(io.StringIO()), quiet("drake"):
                program = runpy.run_path(str(draft / "simulate.py"))
                tau = drake_torque(draft / "arm.urdf", names, motion.q, motion.v, motion.vdot)
        except RuntimeError as error:
            said_why = " ".join(str(error).replace(place, str(folder)).split())
            raise InputError(f"{folder}: the program does not run in Drake: {said_why}") from error
    tau -= _forces(program, presliding_elements(model), motion.q, motion.v)
    files = [folder / name for name in ("arm.urdf", "model.json", "simulate.py")]
    write_text(files[0], texts["arm.urdf"])
    model.save(files[1])
    write_text(files[2], texts["simulate.py"])
    whole = whole_torque(model, motion)
    expected = _smoothed(model, what, motion, smoothing)
    missing = [line for line in what.missing if line.startswith(("terms that", "no bodies"))]
    acting = [t.acting for joint in model.friction.terms for t in joint]
    laws = [a.placed() for a in model.effects]
    acting += [t for law in laws if law is not None for t in law.terms]
    by_load = [t.element for t in acting if t.element.by_load]
    if any(element.way == "memory" for element in by_load):
        missing.append("memory of friction that grows with the load: as if fully slid")
    if by_load:
        missing.append("friction that grows with the load takes the load without acceleration")
    if any(a.effect.name == "transmission_coupling" for a in model.effects):
        missing.append("the inertia of a motor that two joints share")
    missing += [f"{a.effect.label()}: a fault of the record" for a in model.effects if a.effect.sensor]
    missing += [f"{a.effect.label()}: an event of one run" for a in model.effects if a.effect.event]
    missing += [
        f"{a.effect.label()}: the program's clock starts with the joint; the whole model here is that of a warm one"
        for a in model.effects
        if a.effect.of_time and not a.effect.sensor
    ]
    return Exported(
        "drake",
        files,
        "Drake",
        rms_of(whole),
        np.abs(tau - expected).max(axis=0),
        np.abs(tau - whole).max(axis=0),
        missing,
        [*_costs(model, smoothing), *what.notes, NAMES],
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


def _smoothed(model: ReconstructedModel, what: Said, motion: Motion, smoothing: Sequence[float]) -> Array:
    """(N, n) torques of the bodies written and the rest of the model, dry friction smoothed but for what has slid.

    The load that friction grows with is taken without acceleration.
    """
    whole = ModelEquations(model, MATH, smoothing=smoothing)
    bodies = tuple(a for a in model.effects if a.effect.name in ("payload", "rotor_inertia"))
    rigid = ModelEquations(replace(model, effects=bodies), MATH)
    rows = what.torque(motion.q, motion.v, motion.vdot, frozenset())
    still = [0.0] * model.arm.n
    for k, (q, v) in enumerate(zip(motion.q.tolist(), motion.v.tolist(), strict=True)):
        rows[k] += whole.friction(v, whole.load(q, v, still), 0.0, q)
        rows[k] += np.subtract(whole.rigid(q, v, still), rigid.rigid(q, v, still))
        for e in presliding_elements(model):
            x = v[e.joint - 1]
            rows[k, e.joint - 1] += e.level * (MATH.sign(x) - MATH.tanh(x / smoothing[e.joint - 1]))
    return rows


def _smoothing(model: ReconstructedModel, what: Said) -> list[float]:
    """The speeds over which each joint's dry friction may change sign without chatter, two digits.

    A force -F v that is applied explicitly to a plant whose damping D is implicit gives (M + hD) v' = (M - hF) v,
    which is stable while hF < 2M + hD. Half of that is used, at the postures tried, by an F that is diagonal.
    """
    mass = mass_matrix(model.arm, what.links)
    motion = random_motion(model, _POSTURES, seed=5)
    held = np.array([mass(q) for q in motion.q]) + np.diag(what.rotors + 0.5 * _STEP * what.damping)
    inverse = np.linalg.inv(held)
    slope = 1.0 / (_STEP * np.diagonal(inverse, axis1=1, axis2=2).max(axis=0))
    root = np.sqrt(_STEP * slope)
    slope /= np.linalg.eigvalsh(root[:, None] * inverse * root)[:, -1].max()
    loads = _loads(model)
    widths = [_LARGEST_SMOOTHING] * model.arm.n
    for j in range(model.arm.n):
        low, high = _SMALLEST_SMOOTHING, _LARGEST_SMOOTHING
        while high > 1.01 * low:
            middle = float(np.sqrt(low * high))
            tried = [*widths[:j], middle, *widths[j + 1 :]]
            low, high = (low, middle) if _steepness(model, tried, loads, j) <= slope[j] else (middle, high)
        widths[j] = float(f"{high:.2g}")
    return widths


def _steepness(model: ReconstructedModel, widths: Sequence[float], loads: list[float], j: int) -> float:
    """How steeply the friction of joint j that is applied explicitly rises at rest, N m s (N s/m)."""
    equations = ModelEquations(explicit_part(model), MATH, smoothing=widths)
    still = [0.0] * model.arm.n
    speed = 1e-4 * widths[j]
    there, back = (
        equations.friction([*still[:j], side * speed, *still[j + 1 :]], loads, 0.0, still)[j]
        for side in (1, -1)
    )
    return float((there - back) / (2 * speed))


def _loads(model: ReconstructedModel) -> list[float]:
    """(n,) the largest torques at rest that load the joints, at the postures tried."""
    equations, still = ModelEquations(model, MATH), [0.0] * model.arm.n
    postures = random_motion(model, _POSTURES, seed=5).q.tolist()
    return [float(x) for x in np.abs([equations.load(q, still, still) for q in postures]).max(axis=0)]


def _costs(model: ReconstructedModel, smoothing: Sequence[float]) -> list[str]:
    """What the smoothing costs, in a line each, at the joints whose dry friction sets in over more than the model has it."""
    loads, at_once = _loads(model), [1e-6] * model.arm.n
    each = ", ".join(
        f"{smoothing[j]:g} {joint.position_unit}/s at joint {j + 1}"
        for j, joint in enumerate(model.arm.joints)
        if _steepness(model, at_once, loads, j) > 1.01 * _steepness(model, smoothing, loads, j)
    )
    if not each:
        return []
    return [
        f"dry friction sets in as tanh(v/w) instead of at once, so that a step of {_STEP:g} s does not chatter: w is {each}",
        "below w a joint creeps where the model's sticks, and the friction is less than the model's; a step of half the "
        "size needs half of w (simulate.py); armloop's ArmPlant really sticks",
    ]
