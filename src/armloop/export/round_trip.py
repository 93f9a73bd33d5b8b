"""Exported descriptions as their consumers read them: the torques that Drake and MuJoCo get out of a file."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from armloop.util.arrays import Array
from armloop.util.quiet import quiet


class NotInstalled(Exception):
    """The consumer of a format is not at hand."""


def drake_torque(path: Path, joints: Sequence[str], q: Array, v: Array, vdot: Array) -> Array:
    """(N, n) inverse dynamics of a URDF or SDFormat file in Drake: rotors, joint damping and springs included."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import MultibodyForces

    plant = MultibodyPlant(0.0)
    # That its parser drops friction is in the export's own table; its errors are raised, too.
    with quiet("drake", logging.CRITICAL):
        Parser(plant).AddModels(str(path))
    plant.Finalize()
    order = [plant.GetJointByName(name).velocity_start() for name in joints]
    context = plant.CreateDefaultContext()
    forces = MultibodyForces(plant)
    tau = np.empty_like(q)
    state = np.zeros((3, plant.num_velocities()))
    for k in range(len(q)):
        state[:, order] = q[k], v[k], vdot[k]
        plant.SetPositions(context, state[0])
        plant.SetVelocities(context, state[1])
        plant.CalcForceElementsContribution(context, forces)
        # pydrake's inverse dynamics holds M vdot + C v - forces, damping among the forces
        tau[k] = plant.CalcInverseDynamics(context, state[2], forces)[order]
    return tau


def mujoco_torque(path: Path, joints: Sequence[str], q: Array, v: Array, vdot: Array) -> Array:
    """(N, n) inverse dynamics of an MJCF file in MuJoCo, sliding: armature, damping, springs, and frictionloss.

    MuJoCo's dry friction is a constraint that resists up to frictionloss; where a joint slides it is that level against the
    motion, which is how it is counted here. Raises ``NotInstalled`` where there is no MuJoCo.
    """
    try:
        import mujoco
    except ImportError as error:
        raise NotInstalled(
            "MuJoCo is not installed (pip install mujoco): the file was written, not read back"
        ) from error
    model: Any = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS | mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    data: Any = mujoco.MjData(model)
    order = [
        int(model.jnt_dofadr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)]) for name in joints
    ]
    tau = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[order], data.qvel[order], data.qacc[order] = q[k], v[k], vdot[k]
        mujoco.mj_inverse(model, data)
        tau[k] = data.qfrc_inverse[order]
    return np.asarray(tau + model.dof_frictionloss[order] * np.sign(v))
