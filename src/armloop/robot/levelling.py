"""Orientation of a base in the world, from the direction of gravity in its frame; and the arm as seen from a level base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armloop.robot.arm import STANDARD_GRAVITY, Arm
from armloop.util.arrays import Array
from armloop.util.doubts import warn

#: Directions that differ by less, in rad, are one.
_SAME = 1e-3
_DOWN = np.array(STANDARD_GRAVITY) / np.linalg.norm(STANDARD_GRAVITY)


def base_rotation(roll: float, pitch: float) -> Array:
    """R_WB of a base rolled about x, then pitched about y: R_y R_x, as a URDF's ``rpy="roll pitch 0"``."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0, cr, -sr], [-sp, cp * sr, cp * cr]])


def roll_and_pitch(gravity: Array) -> tuple[float, float]:
    """Roll and pitch (rad) of a base in whose frame gravity (3,) acts along this direction: what it tells of R_WB."""
    x, y, z = (float(each) + 0.0 for each in gravity)
    return float(np.arctan2(0.0 - y, 0.0 - z)), float(np.arctan2(x, np.hypot(y, z)))


def say_other_stance(simulated: Arm, gravity: Array, model: Arm, what: str = "the model") -> None:
    """Warn where a model's arm stands otherwise than the simulated one: its base leans, or joints have other zeros.

    Args:
        gravity: (3,) of the simulation in the base frame.
    """
    there, taken = (each / max(float(np.linalg.norm(each)), 1e-12) for each in (gravity, model.gravity))
    angle = float(np.arctan2(np.linalg.norm(np.cross(there, taken)), there @ taken))
    if angle > _SAME:
        roll, pitch = roll_and_pitch(model.gravity)
        warn(
            f"{what}: its base leans by {np.degrees(angle):.1f} degrees against the simulated one, and its gravity torques "
            f"do not fit there; give the simulated arm the effect gravity_tilt (roll {roll:.4f}, pitch {pitch:.4f})"
        )
    zeros = np.zeros((2, model.n))
    for row, arm in zip(zeros, (simulated, model), strict=True):
        row[: len(arm.zeros)] = arm.zeros
    for j in np.flatnonzero(np.abs(zeros[1] - zeros[0]) > _SAME).tolist():
        warn(
            f"{what}: its zero of joint {j + 1} is {zeros[1, j] - zeros[0, j]:.4f} rad off the simulated arm's, and its "
            "torques do not fit there; simulate the arm that the model is of (model.arm)"
        )


def of_a_lean(gravity: Sequence[float], angle: float, std_error: float) -> str:
    """What is said of a base that leans, from its direction of gravity (3,) and the angle with its standard error, rad."""
    angle, error = np.degrees([angle, std_error]).tolist()
    return (
        f"the base leans by {angle:.2f} ± {error:.1g} degrees: gravity acts along {vector(gravity, 4)} of the base frame, "
        f"and the model takes it so; for a URDF that says it, {turning(np.array(gravity))} and reconstruct with that"
    )


def of_a_zero(joint: int, angle: float, std_error: float) -> str:
    """What is said of a joint (from 1) that is further by an angle, with its standard error, than its position says, rad."""
    side = "further" if angle > 0 else "less far"
    return (
        f"joint {joint} is {abs(angle):.4f} ± {std_error:.1g} rad {side} than q{joint} says by the URDF's zero, and the "
        f"model takes it so; {_where_the_zero_is(joint, angle)}"
    )


def of_another_zero(joint: int, angle: float) -> str:
    """What is said of a joint (from 1) that counts from another zero than the URDF, which is further by an angle, rad."""
    return f"joint {joint} counts from another zero than the URDF's; {_where_the_zero_is(joint, angle)}: with that"


def _where_the_zero_is(joint: int, angle: float) -> str:
    sign = "+" if angle > 0 else "-"
    return f"give q{joint} {sign} {abs(angle):.4f}, or turn the joint's origin about its axis in the URDF"


def vector(components: Sequence[float], digits: int) -> str:
    """A vector in words."""
    return "(" + ", ".join(f"{float(x) + 0.0:.{digits}f}" for x in components) + ")"


def turning(gravity: Array) -> str:
    """How a URDF says that gravity acts along a direction (3,) of the base frame."""
    angles = "{:.4f} {:.4f}".format(*roll_and_pitch(gravity))
    return (
        f'turn the base in the URDF (origin rpy="{angles} 0" of the joint that fixes it to the world; where that is turned '
        "already, this turn comes on top, about the world's axes)"
    )


def levelled(arm: Arm) -> Arm:
    """The arm on a level base, its first joint turned instead: what descriptions without a gravity of their own can say."""
    g = float(np.linalg.norm(arm.gravity))
    if not g or np.array_equal(arm.gravity, g * _DOWN):
        return arm
    X_PF, turn = arm.X_PF.copy(), np.eye(4)
    turn[:3, :3] = base_rotation(*roll_and_pitch(arm.gravity))
    X_PF[0] = turn @ X_PF[0]
    return replace(arm, X_PF=X_PF, gravity=g * _DOWN)
