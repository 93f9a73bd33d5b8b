"""Random serial arms with random friction: what a diagnosis may meet, drawn from a seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_AXES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]])


@dataclass(frozen=True)
class RandomArm:
    """A URDF with what a simulation needs beside it: friction per joint, and the ranges of a collection.

    Attributes:
        urdf: its text.
        friction: keyword arguments of ``JointFriction``, one dict per joint.
        ranges: keyword arguments of ``MotionRanges``.
    """

    urdf: str
    friction: list[dict[str, float]]
    ranges: dict[str, list[float]]


def random_arm(seed: int) -> RandomArm:
    """Two to four joints, mostly turning, axes along or across each other, links of boxes, Stribeck friction.

    Torques are sized by hand: a link of m kg at l m needs about m g l.
    """
    rng = np.random.default_rng([seed, 0xA12])
    n = int(rng.choice([2, 3, 3, 3, 4]))
    sliding = [j > 0 and bool(rng.random() < 0.12) for j in range(n)]
    masses = np.sort(rng.uniform(0.4, 3.0, n))[::-1]
    links, joints, friction = [_link("base", 1.0, np.zeros(3), np.full(3, 0.1))], [], []
    ranges: dict[str, list[float]] = {"lower": [], "upper": [], "velocity": [], "acceleration": []}
    previous, axis = np.zeros(3), _AXES[2]
    for j in range(n):
        if j:
            axis = _AXES[rng.integers(3)]
        elif rng.random() < 0.3:
            axis = _AXES[1]
        axis = axis * rng.choice([-1, 1])
        # The lever stands across the axis that turns it, or the joint would move nothing.
        across = _AXES[[k for k in range(3) if not axis[k]][int(rng.integers(2))]]
        lever = across * rng.uniform(0.15, 0.45) + rng.uniform(-0.03, 0.03, 3)
        links.append(_link(f"link_{j + 1}", masses[j], lever * rng.uniform(0.3, 0.7), np.abs(lever) + 0.06))
        turn = rng.uniform(-0.3, 0.3, 3) if rng.random() < 0.3 else np.zeros(3)
        joints.append(_joint(j, sliding[j], axis, previous, turn))
        previous = lever
        load = 9.81 * masses[j:].sum()
        size = load if sliding[j] else load * 0.3
        level = size * rng.uniform(0.05, 0.15)
        friction.append(
            {
                "static": float(level * rng.uniform(1.1, 1.6)),
                "coulomb": float(level),
                "stribeck_velocity": float(rng.uniform(0.04, 0.15) * (0.1 if sliding[j] else 1.0)),
                "viscous": float(size * rng.uniform(0.05, 0.3) * (5.0 if sliding[j] else 1.0)),
            }
        )
        half = rng.uniform(0.08, 0.15) if sliding[j] else rng.uniform(0.9, 2.0)
        speed = rng.uniform(0.1, 0.2) if sliding[j] else rng.uniform(1.0, 1.8)
        for key, value in (
            ("lower", -half),
            ("upper", half),
            ("velocity", speed),
            ("acceleration", 2 * speed),
        ):
            ranges[key].append(float(value))
    urdf = f'<robot name="random_{seed}">\n' + "\n".join([*links, *joints]) + "\n</robot>\n"
    return RandomArm(urdf, friction, ranges)


def _text(values: np.ndarray) -> str:
    return " ".join(f"{x:.6f}" for x in values)


def _link(name: str, mass: float, centre: np.ndarray, sides: np.ndarray) -> str:
    """A box of uniform density."""
    squares = sides**2
    ixx, iyy, izz = (mass / 12 * (squares.sum() - squares[k]) for k in range(3))
    return (
        f'<link name="{name}"><inertial><origin xyz="{_text(centre)}"/><mass value="{mass:.6f}"/>'
        f'<inertia ixx="{ixx:.8f}" iyy="{iyy:.8f}" izz="{izz:.8f}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(j: int, slides: bool, axis: np.ndarray, at: np.ndarray, turn: np.ndarray) -> str:
    parent = f"link_{j}" if j else "base"
    kind, reach, effort = ("prismatic", 0.5, 500) if slides else ("revolute", 3.1, 300)
    return (
        f'<joint name="joint_{j + 1}" type="{kind}"><parent link="{parent}"/><child link="link_{j + 1}"/>'
        f'<origin xyz="{_text(at)}" rpy="{_text(turn)}"/><axis xyz="{_text(axis)}"/>'
        f'<limit lower="{-reach}" upper="{reach}" velocity="4" effort="{effort}"/></joint>'
    )
