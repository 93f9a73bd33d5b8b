"""A URDF read, validated and reduced to a serial chain before any parser meets it: plain XML and numpy.

What a parser would take silently (a mass of ``1kg``, an inertia that no body has), or answer with a traceback, is
answered with one line that names the file and the element. Entities are not expanded and sizes are bounded.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from armloop.util.arrays import Array
from armloop.util.doubts import warn
from armloop.util.errors import ArmError

Element = ElementTree.Element

MOST_JOINTS = 16
"""Moving joints that an arm may have."""
_MOST_BYTES, _MOST_ELEMENTS, _LONGEST_NAME = 8_000_000, 2_000, 128
_MOVING = ("revolute", "continuous", "prismatic")
# Limits beyond these are none: rad or m, and everything else.
_LARGEST = {"lower": 1e6, "upper": 1e6}
_LARGEST_ELSE = 1e12
# Principal moments may miss the triangle inequality by so much of the largest before it is said: rounding in CAD.
_TRIANGLE = 0.01
_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(path: Path) -> Element:
    """The root element of a URDF that has been checked; what is doubtful is said.

    Raises `ArmError`, one line that names the file and the element, when it cannot be read or is not possible.
    """
    root = _parsed(path)
    names = {kind: _names(root, kind, path) for kind in ("link", "joint")}
    if not names["link"]:
        raise ArmError(f"{path}: the URDF has no <link>")
    for link in root.findall("link"):
        _check_inertial(link, path)
    for joint in root.findall("joint"):
        _check_joint(joint, names["link"], path)
    return root


def serial_chain(root: Element, path: Path, lock: Mapping[str, float], tip: str | None) -> Element:
    """The URDF with ``lock``'s joints fixed where they are told, and every moving joint off the way to ``tip`` at zero.

    Links keep their masses: what hangs on a joint that is fixed becomes part of the link it hangs on. Raises
    `ArmError` for names that are none, a locked joint that cannot move, and joints that mimic others and are not locked.
    """
    root = ElementTree.fromstring(ElementTree.tostring(root))
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    moving = [name for name, joint in joints.items() if joint.get("type") in _MOVING]
    for name, value in lock.items():
        if name not in moving:
            raise ArmError(
                f"{path}: --lock {name}: no moving joint of this name; there are: {_listed(moving)}"
            )
        if not np.isfinite(value):
            raise ArmError(f"{path}: --lock {name}={value}: give a finite position in rad (m)")
        _fix(joints[name], value, path)
    if tip is not None:
        _keep_way_to(tip, root, path)
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") in _MOVING:
            raise ArmError(
                f"{path}: joint {name!r} mimics {mimic.get('joint')!r}, a serial arm's joints are free; "
                f"lock it (--lock {name}=0) or name the arm's last link (--tip LINK)"
            )
    left = [name for name, joint in joints.items() if joint.get("type") in _MOVING]
    if len(left) > MOST_JOINTS:
        raise ArmError(
            f"{path}: {len(left)} moving joints, at most {MOST_JOINTS} are supported; lock those that stand still "
            "(--lock JOINT=VALUE) or name the arm's last link (--tip LINK)"
        )
    return root


def _parsed(path: Path) -> Element:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ArmError(f"{path}: larger than {_MOST_BYTES // 10**6} MB, which no URDF is")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ArmError(
            f"{path}: cannot be read ({error.strerror or error}); check the name and the permissions"
        ) from error
    except UnicodeDecodeError as error:
        raise ArmError(f"{path}: unreadable URDF: not a text in UTF-8") from error
    if "<!ENTITY" in text or "<!DOCTYPE" in text:
        raise ArmError(
            f"{path}: unreadable URDF: it declares a document type or entities, which are not expanded"
        )
    if "<xacro:" in text or "${" in text:
        raise ArmError(
            f"{path}: holds xacro (<xacro:...> or ${{...}}); expand it first: xacro in.xacro > out.urdf"
        )
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise ArmError(f"{path}: unreadable URDF: {error}") from error
    if root.tag != "robot":
        raise ArmError(f"{path}: unreadable URDF: the root element is <{root.tag[:40]}>, it must be <robot>")
    return root


def _names(root: Element, kind: str, path: Path) -> list[str]:
    names: list[str] = []
    for element in root.findall(kind):
        name = element.get("name", "")
        if not name:
            raise ArmError(f"{path}: a <{kind}> has no name; each must have one of its own")
        if len(name) > _LONGEST_NAME:
            raise ArmError(
                f"{path}: {kind} {name[:20]!r}...: a name of {len(name)} characters; give at most {_LONGEST_NAME}"
            )
        names.append(name)
    if len(names) > _MOST_ELEMENTS:
        raise ArmError(f"{path}: {len(names)} <{kind}> elements; at most {_MOST_ELEMENTS} are supported")
    twice = (
        next((name for name in names if names.count(name) > 1), None)
        if len(set(names)) < len(names)
        else None
    )
    if twice is not None:
        raise ArmError(f"{path}: {kind} {twice!r} is declared twice; names must be unique")
    return names


def _number(element: Element, key: str, where: str) -> float:
    """One finite number of an attribute that must be there; ``where`` names file and element."""
    text = element.get(key)
    if text is None:
        raise ArmError(f"{where} has no {key}; give a number")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if "_" in text or not np.isfinite(value):
        raise ArmError(
            f"{where} {key}={text[:40]!r} is not a finite number; write it like 0.25, without a unit"
        )
    return value


def _three(element: Element, key: str, where: str) -> Array:
    text = element.get(key, "0 0 0")
    parts = text.split()
    try:
        values = np.array([float(part) for part in parts])
    except ValueError:
        values = np.array([np.nan])
    if len(parts) != 3 or not np.isfinite(values).all():
        raise ArmError(f"{where} {key}={text[:60]!r} must be three finite numbers, such as '0 0 1'")
    if np.abs(values).max() > _LARGEST_ELSE:
        raise ArmError(f"{where} {key}={text[:60]!r} is out of all proportion; give m and rad")
    return values


def _check_origin(element: Element, where: str) -> None:
    for origin in element.findall("origin"):
        for key in ("xyz", "rpy"):
            _three(origin, key, f"{where}: <origin>")


def _check_inertial(link: Element, path: Path) -> None:
    where = f"{path}: link {link.get('name')!r}"
    inertial = link.find("inertial")
    if inertial is None:
        return  # a frame without a body
    _check_origin(inertial, where)
    element = inertial.find("mass")
    if element is None:
        raise ArmError(f"{where}: <inertial> has no <mass>; give its value in kg")
    mass = _number(element, "value", f"{where}: <mass>")
    if not 0 <= mass < _LARGEST_ELSE:
        raise ArmError(f"{where}: <mass> value={mass:g} must not be negative; give kg")
    element = inertial.find("inertia")
    if element is None:
        raise ArmError(
            f"{where}: <inertial> has no <inertia>; give ixx, iyy, izz (and ixy, ixz, iyz) in kg·m²"
        )
    diagonal = [_number(element, key, f"{where}: <inertia>") for key in ("ixx", "iyy", "izz")]
    ixy, ixz, iyz = (
        _number(element, key, f"{where}: <inertia>") if key in element.attrib else 0.0
        for key in ("ixy", "ixz", "iyz")
    )
    tensor = np.diag(diagonal) + np.array([[0, ixy, ixz], [ixy, 0, iyz], [ixz, iyz, 0]])
    if np.abs(tensor).max() > _LARGEST_ELSE:
        raise ArmError(f"{where}: <inertia> holds {np.abs(tensor).max():g}; give kg·m²")
    least, middle, most = np.linalg.eigvalsh(tensor)
    if least < -1e-9 * max(most, abs(least)):
        raise ArmError(
            f"{where}: <inertia> is not positive definite: a principal moment is {least:.4g} kg·m²; no body has it"
        )
    if mass == 0 and most > 0:
        warn(
            f"{where}: <mass> is zero with an <inertia>, which no body has; the link is taken for one without either"
        )
    elif mass > 0 and most == 0:
        warn(f"{where}: <inertia> is zero with a mass of {mass:g} kg; it is taken for a point")
    elif least + middle < most * (1 - _TRIANGLE):
        warn(
            f"{where}: <inertia> has principal moments {least:.4g}, {middle:.4g}, {most:.4g} kg·m²; of a body, two add "
            "up to at least the third, which is taken to be their sum"
        )


def as_of_a_body(link: Element) -> None:
    """Change a checked link's <inertial> to the nearest that a body has, in place; most have one.

    Without mass there is no inertia, and no principal moment is above the sum of the others: Drake would put a ball of
    water in the place of what misses this by the rounding of its digits alone.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    assert mass is not None and tensor is not None
    if float(mass.get("value", "0")) == 0:
        link.remove(inertial)
        return
    xx, xy, xz, yy, yz, zz = (float(tensor.get(key, "0")) for key in _TENSOR)
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if moments[0] >= 0 and moments[2] <= moments[0] + moments[1]:
        return
    moments = np.maximum(moments, 0.0)
    moments[2] = min(moments[2], (moments[0] + moments[1]) * (1 - 1e-9))
    body = (axes * moments) @ axes.T
    for key, value in zip(_TENSOR, body[np.triu_indices(3)], strict=True):
        tensor.set(key, repr(float(value)))


def _check_joint(joint: Element, links: list[str], path: Path) -> None:
    where, kind = f"{path}: joint {joint.get('name')!r}", joint.get("type")
    for end in ("parent", "child"):
        element = joint.find(end)
        name = None if element is None else element.get("link")
        if name is None:
            raise ArmError(f"{where} has no <{end} link=...>; name the link")
        if name not in links and not (end == "parent" and name == "world"):
            raise ArmError(f"{where}: {end} link {name[:40]!r} is not declared")
    _check_origin(joint, where)
    if kind not in _MOVING:
        if kind not in ("fixed", "planar", "floating", "ball"):
            raise ArmError(
                f"{where}: type {str(kind)[:40]!r} is unknown; it must be one of {', '.join(_MOVING)}, fixed"
            )
        return
    axis = joint.find("axis")
    if axis is not None and not np.linalg.norm(_three(axis, "xyz", f"{where}: <axis>")) > 1e-9:
        raise ArmError(f"{where}: <axis> has no length; give a direction such as '0 0 1'")
    limit = joint.find("limit")
    if limit is None:
        return
    values = {}
    for key in ("lower", "upper", "velocity", "effort"):
        if key in limit.attrib:
            values[key] = _number(limit, key, f"{where}: <limit>")
            if abs(values[key]) > _LARGEST.get(key, _LARGEST_ELSE):
                raise ArmError(f"{where}: <limit> {key}={values[key]:g} is no limit; leave it out")
    if values.get("velocity", 1.0) <= 0:
        raise ArmError(
            f"{where}: <limit> velocity={values['velocity']:g} must be positive; leave it out if unknown"
        )
    if values.get("effort", 0.0) < 0:
        raise ArmError(f"{where}: <limit> effort={values['effort']:g} must not be negative")
    lower, upper = values.get("lower", 0.0), values.get("upper", 0.0)
    if kind != "continuous" and ("lower" in values or "upper" in values) and lower >= upper:
        raise ArmError(
            f"{where}: <limit> lower={lower:g} is not below upper={upper:g}; lock a joint that does not move "
            f"(--lock {joint.get('name')}={lower:g})"
        )


def _links(joint: Element) -> tuple[str, str]:
    parent, child = joint.find("parent"), joint.find("child")
    assert parent is not None and child is not None  # _check_joint has seen them
    return parent.get("link", ""), child.get("link", "")


def _keep_way_to(tip: str, root: Element, path: Path) -> None:
    """Fix at zero every moving joint that is not on the way from the base to the link ``tip``."""
    before = {_links(joint)[1]: joint for joint in root.findall("joint")}
    names = [link.get("name", "") for link in root.findall("link")]
    if tip not in names:
        raise ArmError(f"{path}: --tip {tip[:40]}: no link of this name; there are: {_listed(names)}")
    way: set[str] = set()
    link = tip
    while link in before and before[link].get("name", "") not in way:
        way.add(before[link].get("name", ""))
        link = _links(before[link])[0]
    for joint in root.findall("joint"):
        if joint.get("name") not in way and joint.get("type") in _MOVING:
            _fix(joint, 0.0, path)


def _fix(joint: Element, value: float, path: Path) -> None:
    """Make a joint a fixed one at a position; what it can do no more is taken out."""
    where = f"{path}: joint {joint.get('name')!r}"
    origin, axis = joint.find("origin"), joint.find("axis")
    direction = np.array([1.0, 0.0, 0.0]) if axis is None else _three(axis, "xyz", f"{where}: <axis>")
    direction = direction / np.linalg.norm(direction)
    xyz, rpy = np.zeros(3), np.zeros(3)
    if origin is not None:
        xyz, rpy = _three(origin, "xyz", where), _three(origin, "rpy", where)
        joint.remove(origin)
    R = _rotation(rpy)
    if joint.get("type") == "prismatic":
        xyz = xyz + value * (R @ direction)
    else:
        R = R @ _about(direction, value)
    for key in ("axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"):
        for element in joint.findall(key):
            joint.remove(element)
    joint.set("type", "fixed")
    place = {"xyz": " ".join(f"{x:.17g}" for x in xyz), "rpy": " ".join(f"{x:.17g}" for x in _angles(R))}
    joint.append(ElementTree.Element("origin", place))


def _rotation(rpy: Array) -> Array:
    """URDF's fixed-axis roll, pitch and yaw: Rz(yaw) Ry(pitch) Rx(roll)."""
    x, y, z = (_about(axis, angle) for axis, angle in zip(np.eye(3), rpy, strict=True))
    return z @ y @ x


def _about(axis: Array, angle: float) -> Array:
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K))


def _angles(R: Array) -> Array:
    """Roll, pitch and yaw of a rotation; at a pitch of 90° the roll is taken to be zero."""
    across = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = np.arctan2(-R[2, 0], across)
    if across > 1e-12:
        return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])
    return np.array([0.0, pitch, np.arctan2(-R[0, 1], R[1, 1])])


def _listed(names: list[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "") if names else "none"


def base_links(root: Element) -> Iterator[str]:
    """Names of the links that are no joint's child; ``world`` for one that is welded or jointed to it undeclared."""
    names = [link.get("name", "") for link in root.findall("link")]
    parents, children = (
        zip(*(_links(joint) for joint in root.findall("joint")), strict=True)
        if root.findall("joint")
        else ((), ())
    )
    yield from (name for name in names if name not in children)
    if "world" in parents and "world" not in names:
        yield "world"
