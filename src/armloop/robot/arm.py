"""An arm: joint kinds, names, limits and kinematics, read from a URDF.

URDFs are parsed by Drake, so whatever Drake accepts loads here: fixed joints are merged into the
link they are welded to, revolute, continuous and prismatic joints move. The result is plain numpy
and can be kept inside a model file, so that numerics and diagnosis need neither Drake nor the URDF.
"""

from __future__ import annotations

import hashlib
import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from armloop.robot.urdf import as_of_a_body, base_links, read_urdf, rotation_about, serial_chain, urdf_source
from armloop.util.arrays import Array, Mask
from armloop.util.errors import ArmError
from armloop.util.given import path_of, require
from armloop.util.quiet import quiet
from armloop.util.resources import urdf_names, urdf_path

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
_ARRAYS = ("X_PF", "axis", "mass", "com", "inertia", "X_tool", "gravity")


@dataclass(frozen=True)
class Joint:
    """One moving joint.

    ``kind`` is ``"revolute"`` (rad, N·m; URDF's ``continuous`` too) or ``"prismatic"`` (m, N).
    Limits are infinite where the URDF states none.
    """

    name: str
    kind: str
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf

    @property
    def torque_unit(self) -> str:
        """Unit of the generalized force, ``"N*m"`` or ``"N"``."""
        return "N*m" if self.kind == "revolute" else "N"

    @property
    def position_unit(self) -> str:
        """Unit of the coordinate, ``"rad"`` or ``"m"``."""
        return "rad" if self.kind == "revolute" else "m"


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial arm of n moving joints, numbered base to tip.

    Link i's frame M_i coincides with its joint frame F_i at q_i = 0 and moves along or about
    ``axis[i]``; ``X_PF[i]`` is the pose of F_i in M_{i-1} (in the base for the first joint).

    Attributes:
        X_PF: (n, 4, 4) homogeneous poses.
        axis: (n, 3) unit axes in F_i.
        mass, com, inertia: (n,), (n, 3) m, (n, 3, 3) kg·m² nominal parameters of the links in M_i,
            inertia about M_i's origin. They may be dummies in a URDF made for kinematics.
        X_tool: (4, 4) pose of the link ``tool`` in M_n, the identity without such a link.
        gravity: (3,) m/s² in the base frame.
        zeros: (n,) rad by which the joints are further than their positions say, by the URDF's zeros; ``X_PF`` has them
            already. All zero but for an arm whose records have shown otherwise.
        urdf: the URDF's text, empty for an arm rebuilt from a model file.
    """

    name: str
    joints: tuple[Joint, ...]
    X_PF: Array
    axis: Array
    mass: Array
    com: Array
    inertia: Array
    X_tool: Array = field(default_factory=lambda: np.eye(4))
    gravity: Array = field(default_factory=lambda: np.array(STANDARD_GRAVITY))
    urdf: str = ""
    zeros: Array = field(default_factory=lambda: np.zeros(0))

    def __repr__(self) -> str:
        return f"<armloop.Arm {self.name}: {self.n} joint{'s' if self.n > 1 else ''}, {self.mass.sum():.3g} kg moving>"

    def __str__(self) -> str:
        """A line per joint: kind, limits of position, velocity and effort in SI units."""
        rows = [("joint", "kind", "from", "to", "unit", "velocity", "effort", "mass [kg]")]
        rows += [
            (
                joint.name,
                joint.kind,
                f"{joint.lower:.4g}",
                f"{joint.upper:.4g}",
                joint.position_unit,
                f"{joint.velocity:.4g}",
                f"{joint.effort:.4g}",
                f"{mass:.4g}",
            )
            for joint, mass in zip(self.joints, self.mass, strict=True)
        ]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        return "\n".join([repr(self)[1:-1], "", *lines])

    @property
    def n(self) -> int:
        """Number of moving joints."""
        return len(self.joints)

    @property
    def revolute(self) -> Mask:
        """(n,) true where the joint turns, false where it slides."""
        return np.array([joint.kind == "revolute" for joint in self.joints])

    @property
    def effort(self) -> Array:
        """(n,) limits of the generalized forces, N·m (N); infinite where there is none."""
        return np.array([joint.effort for joint in self.joints])

    def with_tool_at(self, point: Any) -> Arm:
        """The arm with its tool moved to a point (3,) of the tool's frame, m."""
        X_tool = self.X_tool.copy()
        X_tool[:3, 3] += X_tool[:3, :3] @ np.asarray(point, dtype=float)
        return replace(self, X_tool=X_tool)

    @property
    def joint_names(self) -> list[str]:
        """Name of each joint, base to tip."""
        return [joint.name for joint in self.joints]

    @property
    def torque_units(self) -> list[str]:
        """Unit of each joint's generalized force."""
        return [joint.torque_unit for joint in self.joints]

    def with_zero(self, joint: int, angle: float) -> Arm:
        """The arm whose turning joint (0-based) is further by an angle in rad than its position says."""
        X_PF, zeros = self.X_PF.copy(), np.zeros(self.n)
        X_PF[joint, :3, :3] = X_PF[joint, :3, :3] @ rotation_about(self.axis[joint], angle)
        zeros[: len(self.zeros)] = self.zeros
        zeros[joint] += angle
        return replace(self, X_PF=X_PF, zeros=zeros)

    def fingerprint(self) -> str:
        """Digest of the joint kinds and the kinematics of the URDF: two arms that agree in it move alike.

        Masses do not enter: a model is made for a geometry, and nominal inertias are often dummies.
        """
        X_PF = self.X_PF.copy()
        for j in np.flatnonzero(self.zeros).tolist():
            X_PF[j, :3, :3] = X_PF[j, :3, :3] @ rotation_about(self.axis[j], -self.zeros[j])
        parts = {
            "kinds": [joint.kind for joint in self.joints],
            "X_PF": _rounded(X_PF),
            "axis": _rounded(self.axis),
        }
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]

    def to_dict(self) -> dict[str, Any]:
        """The arm as JSON-ready values (without the URDF's text)."""
        joints = []
        for joint in self.joints:
            limits = {key: getattr(joint, key) for key in ("lower", "upper", "velocity", "effort")}
            finite = {key: value for key, value in limits.items() if np.isfinite(value)}
            joints.append({"name": joint.name, "kind": joint.kind, **finite})
        return {
            "name": self.name,
            "fingerprint": self.fingerprint(),
            "joints": joints,
            **{key: getattr(self, key).tolist() for key in _ARRAYS},
            **({"zeros": self.zeros.tolist()} if self.zeros.any() else {}),
        }

    @staticmethod
    def from_dict(data: dict[str, Any]) -> Arm:
        """Rebuild an arm from :meth:`to_dict`, the content of a file as `armloop.schemas.model` checks it."""
        arrays: dict[str, Any] = {
            key: np.array(data[key], dtype=float) for key in (*_ARRAYS, "zeros") if key in data
        }
        return Arm(data["name"], tuple(Joint(**joint) for joint in data["joints"]), **arrays)

    def require_same(self, other: Arm, what: str) -> None:
        """Raise ``ArmError`` unless ``other`` has this arm's joints and geometry."""
        if self.n != other.n:
            raise ArmError(
                f"{what}: made for {self.name} with {self.n} joints, not for {other.name} with {other.n}"
            )
        if self.fingerprint() != other.fingerprint():
            raise ArmError(
                f"{what}: made for {self.name} ({self.fingerprint()}), but {other.name} has other "
                f"kinematics ({other.fingerprint()}); use the URDF the model was made with"
            )


def _rounded(values: Array) -> Any:
    return (np.round(values, 6) + 0.0).tolist()


def load_arm(spec: str | Path, lock: Mapping[str, float] | None = None, tip: str | None = None) -> Arm:
    """Load a built-in arm by name, or any serial arm from the path of a URDF.

    Args:
        lock: positions (rad, m) of moving joints that are to be fixed there, such as those of a gripper.
        tip: name of the arm's last link, or of one fixed to it; moving joints off the way to it are fixed at zero.

    What is doubtful about the URDF is said as :class:`~armloop.util.errors.InputWarning`.

    Raises:
        ArmError: the name is unknown, the file cannot be read or parsed or describes what cannot be, or the
            mechanism is not a single chain of revolute, continuous and prismatic joints.
    """
    text_spec = str(path_of(spec, "the arm", ArmError))
    require("a word or None", tip=tip)
    given: Any = lock
    if not isinstance(given, Mapping | None):
        kind = type(given).__name__
        raise ArmError(
            f"lock must be positions by joint, such as {{'finger_joint': 0.02}}; it is of type {kind}"
        )
    require("a number", **{f"lock {name}": value for name, value in (lock or {}).items()})
    path = urdf_path(text_spec) if text_spec in urdf_names() else Path(text_spec)
    try:
        found = path.is_file()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ArmError(f"{text_spec[:200]}: cannot be read ({reason}); give the path of a URDF") from error
    if not found and path.is_dir():
        raise ArmError(f"{text_spec[:200]}: is a folder; give the path of a URDF in it")
    if not found:
        hint = "" if "/" in text_spec or text_spec.endswith(".urdf") else " and no built-in arm"
        known = ", ".join(urdf_names())
        raise ArmError(f"{text_spec[:200]}: no such file{hint}; give the path of a URDF or one of: {known}")
    root = read_urdf(path)
    root = serial_chain(root, path, lock or {}, tip)
    changed = bool(lock) or tip is not None
    urdf = ElementTree.tostring(root, encoding="unicode") if changed else urdf_source(path)
    return _from_urdf(root, urdf, path)


def mechanics_only(root: ElementTree.Element) -> str:
    """The URDF without geometry, sensors and vendor tags: meshes need not exist to load the mechanics."""
    slim = ElementTree.Element("robot", root.attrib)
    for element in (element for element in root if element.tag in ("link", "joint")):
        copy = deepcopy(element)
        for child in list(copy):
            if child.tag in {"visual", "collision"}:
                copy.remove(child)
        if copy.tag == "link":
            as_of_a_body(copy)
        slim.append(copy)
    return ElementTree.tostring(slim, encoding="unicode")


def _from_urdf(root: ElementTree.Element, urdf: str, path: Path) -> Arm:
    # Drake is imported here: a command that fails before it needs an arm should not wait for it.
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import JointIndex, RevoluteJoint, WeldJoint

    plant = MultibodyPlant(time_step=0.0)
    bases = list(base_links(root))
    if len(bases) != 1:
        found = ", ".join(bases) or "none (a loop)"
        raise ArmError(f"{path}: a serial arm has exactly one base link, this URDF has {len(bases)}: {found}")
    try:
        # What it warns of (links without mass, joints it does not know) is checked here or in `urdf`.
        with quiet("drake"):
            (instance,) = Parser(plant).AddModelsFromString(mechanics_only(root), "urdf")
        # A root link called "world" is Drake's world itself: nothing is left to weld.
        if bases != ["world"]:
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(bases[0], instance))
        plant.Finalize()
    except (RuntimeError, ValueError) as error:
        raise ArmError(f"{path}: unreadable URDF: {error}") from error

    every = (plant.get_joint(JointIndex(index)) for index in range(plant.num_joints()))
    moving = [joint for joint in every if not isinstance(joint, WeldJoint)]
    if not moving:
        raise ArmError(f"{path}: the URDF has no moving joint; an arm needs at least one")
    moving = _ordered_chain(plant, moving, path)

    context = plant.CreateDefaultContext()
    n = len(moving)
    joints: list[Joint] = []
    X_PF = np.zeros((n, 4, 4))
    axis, mass, com, inertia = np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3))
    previous = plant.world_frame()
    for i, joint in enumerate(moving):
        frame_M = joint.frame_on_child()
        X_PF[i] = joint.frame_on_parent().CalcPose(context, previous).GetAsMatrix4()
        revolute = isinstance(joint, RevoluteJoint)
        axis[i] = joint.revolute_axis() if revolute else joint.translation_axis()
        bodies = [body.index() for body in plant.GetBodiesWeldedTo(joint.child_body())]
        M_link = plant.CalcSpatialInertia(context, frame_M, bodies)
        mass[i] = M_link.get_mass()
        com[i] = M_link.get_com() if mass[i] > 0 else 0.0
        inertia[i] = M_link.CalcRotationalInertia().CopyToFullMatrix3() if mass[i] > 0 else 0.0
        joints.append(
            Joint(
                name=joint.name(),
                kind="revolute" if revolute else "prismatic",
                lower=float(joint.position_lower_limits()[0]),
                upper=float(joint.position_upper_limits()[0]),
                velocity=float(joint.velocity_upper_limits()[0]),
                effort=_effort_limit(root, joint.name()),
            )
        )
        previous = frame_M
    X_tool = np.eye(4)
    tip = [body.index() for body in plant.GetBodiesWeldedTo(moving[-1].child_body())]
    if plant.HasBodyNamed("tool") and plant.GetBodyByName("tool").index() in tip:
        X_tool = plant.GetBodyByName("tool").body_frame().CalcPose(context, previous).GetAsMatrix4()
    name = root.get("name") or path.stem
    return Arm(name, tuple(joints), X_PF, axis, mass, com, inertia, X_tool, urdf=urdf)


def _ordered_chain(plant: Any, moving: list[Any], path: Path) -> list[Any]:
    """The moving joints from base to tip; raises ``ArmError`` if the mechanism branches."""
    ordered: list[Any] = []
    tip = plant.world_body()
    while len(ordered) < len(moving):
        rigid = {body.index() for body in plant.GetBodiesWeldedTo(tip)}
        following = [joint for joint in moving if joint.parent_body().index() in rigid]
        if len(following) != 1:
            names = ", ".join(joint.name() for joint in following) or "none"
            after = f"link {tip.name()!r}" if ordered else "the base"
            raise ArmError(
                f"{path}: not a serial arm: {len(following)} moving joints follow {after} ({names}); "
                "lock a gripper's joints (--lock JOINT=VALUE) or name the arm's last link (--tip LINK)"
            )
        ordered.append(following[0])
        tip = following[0].child_body()
    return ordered


def _effort_limit(root: ElementTree.Element, name: str) -> float:
    """The URDF's effort limit; Drake keeps it only for joints with a transmission."""
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        if joint.get("name") == name and limit is not None and limit.get("effort"):
            effort = float(limit.get("effort", ""))
            return effort if effort > 0 else np.inf
    return np.inf
