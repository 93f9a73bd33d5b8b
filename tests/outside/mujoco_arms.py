"""Random serial arms in MuJoCo: an engine, controllers and noise that armloop has no part in.

What judges never imports what generates: this module knows nothing of armloop, and armloop nothing of it. An arm is
drawn from a seed, written as URDF for armloop and as MJCF for MuJoCo, and moved along a reference by a controller of
its own; what a drive would record comes back as columns of a motion log.

    arm = random_arm(seed=3, joints=3)
    arm.write_urdf("arm.urdf")
    columns = arm.simulate(fourier_reference(arm, seed=1, seconds=30.0), effects=[...], seed=2)
    write_log(columns, "run.csv")

Friction here is MuJoCo's: ``frictionloss``, a constraint that sticks, ``damping`` and ``armature``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Link:
    """A joint with the link that it carries.

    origin, rpy: of the joint in the link before, m and rad (fixed axes x, y, z, as in URDF); axis: in the joint's frame.
    mass, com, inertia: kg, m, and (3, 3) kg·m² about the centre of mass, in the link's frame.
    frictionloss N·m, damping N·m·s/rad, armature kg·m² (N, N·s/m, kg for a joint that slides).
    reach, speed: half the range of motion, rad (m), and the largest speed, rad/s (m/s).
    """

    slides: bool
    origin: Array
    rpy: Array
    axis: Array
    mass: float
    com: Array
    inertia: Array
    frictionloss: float
    damping: float
    armature: float
    reach: float
    speed: float


@dataclass(frozen=True)
class OutsideArm:
    """A serial arm: its links from base to tip."""

    name: str
    links: tuple[Link, ...]

    @property
    def joints(self) -> int:
        """How many joints."""
        return len(self.links)

    def urdf(self, mass_error: float = 0.0) -> str:
        """The arm as URDF; the inertial entries are wrong by a part ``mass_error``, as a data sheet's are."""
        parts = [f'<robot name="{self.name}">', '<link name="base"/>']
        for k, link in enumerate(self.links):
            entries = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), _six(link.inertia), strict=True)
            inertia = " ".join(f'{name}="{value * (1 + mass_error)!r}"' for name, value in entries)
            parts += [
                f'<link name="link_{k + 1}"><inertial><origin xyz="{_text(link.com)}"/>'
                f'<mass value="{link.mass * (1 + mass_error)!r}"/><inertia {inertia}/></inertial></link>',
                f'<joint name="joint_{k + 1}" type="{"prismatic" if link.slides else "revolute"}">'
                f'<parent link="{f"link_{k}" if k else "base"}"/><child link="link_{k + 1}"/>'
                f'<origin xyz="{_text(link.origin)}" rpy="{_text(link.rpy)}"/><axis xyz="{_text(link.axis)}"/>'
                f'<limit lower="{-link.reach!r}" upper="{link.reach!r}" velocity="{link.speed!r}" effort="1000"/></joint>',
            ]
        return "\n".join([*parts, "</robot>", ""])

    def write_urdf(self, path: str | Path, mass_error: float = 0.0) -> Path:
        """Write :meth:`urdf`."""
        path = Path(path)
        path.write_text(self.urdf(mass_error), encoding="utf-8")
        return path

    def mjcf(self, timestep: float, tendons: Sequence[dict[str, float]] = ()) -> str:
        """The arm as MJCF; fixed tendons couple two joints: ``joint``, ``other_joint``, ``ratio`` and a tendon's own
        ``damping``, ``frictionloss``, ``armature``."""
        bodies, closing = [], []
        # Friction as a constraint that is as hard as the step allows: the joint sticks.
        solver = f'solreffriction="{2 * timestep:g} 1" solimpfriction="0.95 0.99 0.001"'
        for k, link in enumerate(self.links):
            entries = _text(_six(link.inertia))
            bodies.append(
                f'<body name="link_{k + 1}" pos="{_text(link.origin)}" quat="{_text(_quaternion(link.rpy))}">'
                f'<inertial pos="{_text(link.com)}" mass="{link.mass!r}" fullinertia="{entries}"/>'
                f'<joint name="joint_{k + 1}" type="{"slide" if link.slides else "hinge"}" axis="{_text(link.axis)}" '
                f'frictionloss="{link.frictionloss!r}" damping="{link.damping!r}" armature="{link.armature!r}" {solver}/>'
            )
            closing.append("</body>")
        coupled = [
            f'<fixed damping="{t.get("damping", 0.0)!r}" frictionloss="{t.get("frictionloss", 0.0)!r}" '
            f'armature="{t.get("armature", 0.0)!r}" {solver}>'
            f'<joint joint="joint_{int(t["joint"])}" coef="1"/>'
            f'<joint joint="joint_{int(t["other_joint"])}" coef="{t["ratio"]!r}"/></fixed>'
            for t in tendons
        ]
        return (
            f'<mujoco><compiler angle="radian" balanceinertia="false"/>'
            f'<option timestep="{timestep!r}" gravity="0 0 -9.81" integrator="Euler">'
            f'<flag eulerdamp="disable" contact="disable"/></option>'
            f"<worldbody>{''.join(bodies)}{''.join(closing)}</worldbody>"
            f"<tendon>{''.join(coupled)}</tendon></mujoco>"
        )

    def simulate(
        self, reference: Any, effects: Sequence[dict[str, Any]] = (), seed: int = 0, **how: Any
    ) -> Any:
        """Columns of a log; see :func:`outside.mujoco_run.simulate`."""
        from outside.mujoco_run import simulate

        return simulate(self, reference, effects, seed, **how)


def random_arm(seed: int, joints: int = 3, sliding: bool = False, wrist: bool = False) -> OutsideArm:
    """An arm of ``joints`` joints: axes along x, y or z, skewed frames, links of unlike shape, friction of every size.

    Args:
        sliding: whether one of the later joints may slide.
        wrist: whether the last links are short and light, as a wrist's are.
    """
    rng = np.random.default_rng([seed, joints, 0xB0D7])
    slider = int(rng.integers(1, joints)) if sliding and joints > 1 else -1
    axes, links = np.eye(3), []
    lever = np.zeros(3)
    masses = np.sort(rng.uniform(0.5, 5.0, joints))[::-1]
    before = None
    for k in range(joints):
        # The first joint stands upright in two arms of three; a later one is parallel to the one before in one of three.
        choices = [2] if k == 0 and rng.random() < 0.67 else [0, 1, 2]
        a = int(before if before is not None and rng.random() < 0.33 else rng.choice(choices))
        before = a
        small = wrist and k >= joints - 2
        across = [i for i in range(3) if i != a]
        length = rng.uniform(0.05, 0.12) if small else rng.uniform(0.2, 0.45)
        step = length * axes[int(rng.choice(across))] + rng.uniform(-0.03, 0.03, 3)
        mass = float(masses[k]) * (0.3 if small else 1.0)
        com = step * rng.uniform(0.3, 0.7) + rng.uniform(-0.02, 0.02, 3)
        # A solid of three unequal half-lengths, turned: positive definite and within the triangle inequalities.
        halves = (np.abs(step) / 2 + rng.uniform(0.02, 0.05, 3)) ** 2
        principal = mass / 3 * (halves.sum() - halves)
        turned = _rotation(rng.uniform(-0.4, 0.4, 3))
        weight = 9.81 * masses[k:].sum()
        slides = k == slider
        size = float(weight if slides else weight * 0.25)
        links.append(
            Link(
                slides=slides,
                origin=lever if k else np.array([0.0, 0.0, 0.1]),
                rpy=rng.uniform(-0.4, 0.4, 3) if k and rng.random() < 0.4 else np.zeros(3),
                axis=axes[a] * float(rng.choice([-1.0, 1.0])),
                mass=mass,
                com=com,
                inertia=turned @ np.diag(principal) @ turned.T,
                frictionloss=size * float(rng.uniform(0.03, 0.15)),
                damping=size * float(rng.uniform(0.03, 0.2)),
                armature=float(rng.uniform(0.02, 0.15)) * mass * (1.0 if slides else length**2),
                reach=float(rng.uniform(0.1, 0.2) if slides else rng.uniform(1.0, 2.4)),
                speed=float(rng.uniform(0.2, 0.4) if slides else rng.uniform(1.0, 2.0)),
            )
        )
        lever = step
    return OutsideArm(f"outside_{seed}_{joints}", tuple(links))


def write_log(columns: dict[str, Array], path: str | Path) -> Path:
    """Write the columns ``time``, ``q…``, ``v…`` and ``tau…`` as a CSV motion log."""
    path = Path(path)
    names = [name for name in columns if name == "time" or name[0] in "qv" or name.startswith("tau")]
    names = [name for name in names if not name.startswith("vdot")]
    table = np.column_stack([columns[name] for name in names])
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=",".join(names), comments="")
    return path


def _rotation(rpy: Array) -> Array:
    """(3, 3) rotation by roll, pitch, yaw about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _quaternion(rpy: Array) -> Array:
    """(w, x, y, z) of the same rotation."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy / 2), np.sin(rpy / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def _six(inertia: Array) -> list[float]:
    """xx, yy, zz, xy, xz, yz."""
    return [float(inertia[i]) for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _text(values: Any) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(values).ravel())
