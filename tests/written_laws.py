"""Laws of listed effects as plain arrays for a three-axis arm: what a diagnosis must find, from no package under test."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.robot.kinematics import nominal_parameters, regressor

Law = Callable[[Motion], np.ndarray]
Place = tuple[str, int | None]


def on_joint(motion: Motion, joint: int, torque: np.ndarray) -> np.ndarray:
    tau = np.zeros_like(motion.q)
    tau[:, joint - 1] = torque
    return tau


def payload(motion: Motion) -> np.ndarray:
    """0.45 kg, a ball of 3 cm radius at (-0.05, 0.02, -0.03) m of the tool, 0.35 m along the last link."""
    mass, com = 0.45, np.array([0.30, 0.02, -0.03])
    inertia = mass * (com @ com * np.eye(3) - np.outer(com, com)) + 0.4 * mass * 0.03**2 * np.eye(3)
    entries = [inertia[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    Y = regressor(three_axis(), motion.q, motion.v, motion.vdot)[:, :, 20:]
    return Y @ np.array([mass, *(mass * com), *entries])


def tilt(motion: Motion) -> np.ndarray:
    """The base rolled by 0.06 rad about x, then pitched by -0.04 rad about y."""
    cr, sr, cp, sp = np.cos(0.06), np.sin(0.06), np.cos(-0.04), np.sin(-0.04)
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    arm, rest = three_axis(), np.zeros_like(motion.q)
    level, tilted = (
        regressor(arm, motion.q, rest, rest, g) for g in (arm.gravity, (Ry @ Rx).T @ arm.gravity)
    )
    return (tilted - level) @ nominal_parameters(arm)


def load(motion: Motion) -> np.ndarray:
    """What passes the joints."""
    return rigid_torque(three_axis(), motion.q, motion.v, motion.vdot)


def total(motion: Motion) -> np.ndarray:
    """What the drives supply."""
    return load(motion) + friction(motion.v)


def late(motion: Motion) -> np.ndarray:
    """What a record that lags by 30 ms shows in addition."""
    tau = total(motion)
    lagging = [np.interp(motion.time - 0.03, motion.time, column) for column in tau.T]
    return np.column_stack(lagging) - tau


def stop(q: np.ndarray, width: float) -> np.ndarray:
    """An elasto-plastic element, sample by sample."""
    z, out = 0.0, [0.0]
    for step in np.diff(q):
        z = min(max(z + step, -width), width)
        out.append(z / width)
    return np.array(out)


# effect, joint -> the law, and the parameters that must come out
CASES: dict[Place, tuple[Law, dict[str, object]]] = {
    ("payload", None): (payload, {"mass": 0.45, "com": [-0.05, 0.02, -0.03]}),
    ("viscous_friction", 2): (lambda m: on_joint(m, 2, 0.6 * m.v[:, 1]), {"coefficient": 0.6}),
    ("coulomb_friction", 1): (lambda m: on_joint(m, 1, 0.3 * np.sign(m.v[:, 0])), {"level": 0.3}),
    ("coulomb_friction", 3): (lambda m: on_joint(m, 3, -0.2 * np.sign(m.v[:, 2])), {"level": -0.2}),
    ("joint_spring", 2): (
        lambda m: on_joint(m, 2, 1.5 * (m.q[:, 1] - 0.3)),
        {"stiffness": 1.5, "rest": 0.3},
    ),
    ("upper_end_stop", 3): (
        lambda m: on_joint(m, 3, 2.0 * np.maximum(m.q[:, 2] - 0.25, 0.0)),
        {"stiffness": 2.0, "begins": 0.25},
    ),
    ("lower_end_stop", 1): (
        lambda m: on_joint(m, 1, 3.0 * np.minimum(m.q[:, 0] + 0.1, 0.0)),
        {"stiffness": 3.0, "begins": -0.1},
    ),
    ("torque_ripple", 3): (
        lambda m: on_joint(m, 3, 0.25 * np.sin(9 * m.q[:, 2] + 0.8)),
        {"amplitude": 0.25, "order": 9, "phase": 0.8},
    ),
    # behind a gear whose ratio is no whole number
    ("torque_ripple", 2): (
        lambda m: on_joint(m, 2, 0.5 * np.sin(10.37 * m.q[:, 1] + 0.8)),
        {"amplitude": 0.5, "order": 10.37, "phase": 0.8},
    ),
    ("rotor_inertia", 1): (lambda m: on_joint(m, 1, 0.25 * m.vdot[:, 0]), {"inertia": 0.25}),
    ("torque_offset", 3): (lambda m: on_joint(m, 3, np.full(m.samples, 0.4)), {"offset": 0.4}),
    ("gravity_tilt", None): (tilt, {"roll": 0.06, "pitch": -0.04}),
    ("stribeck_friction", 2): (
        lambda m: on_joint(m, 2, 0.7 * np.exp(-((m.v[:, 1] / 0.25) ** 2)) * np.sign(m.v[:, 1])),
        {"static_excess": 0.7, "velocity": 0.25},
    ),
    ("load_dependent_friction", 2): (
        lambda m: on_joint(m, 2, 0.08 * np.abs(load(m)[:, 1]) * np.sign(m.v[:, 1])),
        {"coefficient": 0.08},
    ),
    ("viscous_asymmetry", 1): (
        lambda m: on_joint(m, 1, 0.25 * np.abs(m.v[:, 0])),
        {"coefficient": 0.25},
    ),
    ("quadratic_drag", 3): (
        lambda m: on_joint(m, 3, 0.4 * m.v[:, 2] * np.abs(m.v[:, 2])),
        {"coefficient": 0.4},
    ),
    ("friction_drift", 3): (
        lambda m: on_joint(m, 3, 0.6 * np.exp(-m.time / 15.0) * np.sign(m.v[:, 2])),
        {"level": 0.6, "time_constant": 15.0},
    ),
    ("presliding_hysteresis", 3): (
        lambda m: on_joint(m, 3, 0.5 * stop(m.q[:, 2], 0.05)),
        {"level": 0.5, "width": 0.05},
    ),
    ("torque_gain", 2): (lambda m: on_joint(m, 2, 0.08 * total(m)[:, 1]), {"gain": 1.08}),
    ("encoder_offset", 2): (
        lambda m: total(replace(m, q=m.q - [0.0, 0.04, 0.0])) - total(m),
        {"offset": 0.04},
    ),
    ("time_delay", None): (late, {"seconds": 0.03}),
}
COUPLING = {"inertia": 0.1, "viscous": 0.3, "coulomb": 0.2, "ratio": -1.0}


def coupling(motion: Motion) -> np.ndarray:
    """A motor that turns with the difference of the speeds of joints 2 and 3."""
    w, wdot = motion.v[:, 1] - motion.v[:, 2], motion.vdot[:, 1] - motion.vdot[:, 2]
    torque = 0.1 * wdot + 0.3 * w + 0.2 * np.sign(w)
    return on_joint(motion, 2, torque) - on_joint(motion, 3, torque)


def run(law: Law | None, seed: int, seconds: float = 30.0, rate: float = 100.0) -> MotionLog:
    """A log of the arm with friction, and with the law's torque on top."""
    motion = fourier_motion(seconds, rate, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau + (law(motion) if law else 0.0), seed)
