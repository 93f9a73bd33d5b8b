"""A URDF read, validated and reduced to a serial chain before any parser meets it: plain XML and numpy.

Its links and joints are checked by :mod:`armloop.robot.urdf_checks`. Entities are not expanded and sizes are bounded.
"""

from __future__ import annotations

import codecs
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from xml.parsers import expat

import numpy as np

from armloop.robot.urdf_checks import MOVING, check_joint, check_link, three
from armloop.schemas.types import MOST_JOINTS
from armloop.util.arrays import Array
from armloop.util.doubts import warn
from armloop.util.errors import ArmError

Element = ElementTree.Element

_MOST_BYTES, _MOST_ELEMENTS, _LONGEST_NAME = 8_000_000, 2_000, 128
_ENCODING = re.compile(rb"""\s*<\?xml[^>]*\sencoding=["']([\w.-]+)["']""")
_DECLARATION = re.compile(r"^<\?xml.*?\?>", re.DOTALL)
_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(path: Path) -> Element:
    """The root element of a URDF that has been checked; what is doubtful is said.

    Raises `ArmError`, one line that names the file and the element, when it cannot be read or is not possible.
    """
    root = _parsed(path)
    names = {kind: _names(root, kind, path) for kind in ("link", "joint")}
    if not names["link"]:
        raise ArmError(f"{path}: the URDF has no <link>")
    for joint in root.findall("joint"):
        check_joint(joint, names["link"], f"{path}: joint {joint.get('name')!r}")
    _check_tree(root, path)
    still = _never_moved(root)
    for link in root.findall("link"):
        check_link(link, f"{path}: link {link.get('name')!r}", moves=link.get("name") not in still)
    return root


def serial_chain(root: Element, path: Path, lock: Mapping[str, float], tip: str | None) -> Element:
    """The URDF with ``lock``'s joints fixed where they are told, and every moving joint off the way to ``tip`` at zero.

    Links keep their masses: what hangs on a joint that is fixed becomes part of the link it hangs on. Raises
    `ArmError` for names that are none, a locked joint that cannot move, and joints that mimic others and are not locked.
    """
    root = deepcopy(root)
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    moving = [name for name, joint in joints.items() if joint.get("type") in MOVING]
    for name, value in lock.items():
        if name not in moving:
            raise ArmError(
                f"{path}: --lock {name}: no moving joint of this name; there are: {_listed(moving)}"
            )
        if not np.isfinite(value):
            raise ArmError(f"{path}: --lock {name}={value}: give a finite position in rad (m)")
        _say_beyond(joints[name], value, f"{path}: --lock {name}={value:g}")
        _fix(joints[name], value, path)
    if tip is not None:
        _keep_way_to(tip, root, path)
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") in MOVING:
            raise ArmError(
                f"{path}: joint {name!r} mimics {mimic.get('joint')!r}, "
                f"{'' if mimic.get('joint') in joints else 'which no joint is called, and '}a serial arm's joints are free; "
                f"lock it (--lock {name}=0) or name the arm's last link (--tip LINK)"
            )
    left = [name for name, joint in joints.items() if joint.get("type") in MOVING]
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
        text = urdf_source(path)
    except OSError as error:
        raise ArmError(
            f"{path}: cannot be read ({error.strerror or error}); check the name and the permissions"
        ) from error
    if "<!ENTITY" in text or "<!DOCTYPE" in text:
        raise ArmError(
            f"{path}: unreadable URDF: it declares a document type or entities, which are not expanded"
        )
    try:
        root = urdf_tree(text)
    except expat.ExpatError as error:
        raise ArmError(f"{path}: unreadable URDF: {error}") from error
    if any(_is_xacro(element) for element in root.iter()):  # what stands in comments is nobody's
        raise ArmError(
            f"{path}: holds xacro (<xacro:...> or ${{...}}); expand it first: xacro in.xacro > out.urdf"
        )
    if root.tag != "robot":
        raise ArmError(f"{path}: unreadable URDF: the root element is <{root.tag[:40]}>, it must be <robot>")
    if not root.get("name"):
        raise ArmError(f'{path}: <robot> has no name; give it one, such as <robot name="arm">')
    return root


def urdf_source(path: Path) -> str:
    """A URDF's text without what stands before its XML: in UTF-8, or in the encoding that it declares or begins with.

    Raises `ArmError` where it is none of them.
    """
    raw = path.read_bytes()
    declared = _ENCODING.match(raw)
    marked = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    told = "utf-16" if marked else declared[1].decode() if declared else "utf-8"
    for encoding in ("utf-8-sig", told):
        try:
            text = raw.decode(encoding).lstrip()
        except (UnicodeError, LookupError):
            continue
        # the text is kept in UTF-8, whatever it came in
        return text if encoding != told else _DECLARATION.sub('<?xml version="1.0"?>', text)
    raise ArmError(f"{path}: unreadable URDF: not a text in UTF-8, nor in an encoding that it declares")


def urdf_tree(text: str) -> Element:
    """Root element of a URDF's text, names as they stand there: the prefix of ``drake:acceleration`` need not be declared.

    URDF's parsers know no namespaces, and files that they read declare none. Raises `expat.ExpatError`.
    """
    tree, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    parser.CharacterDataHandler = tree.data
    parser.Parse(text, True)
    return tree.close()


def _is_xacro(element: Element) -> bool:
    return element.tag.startswith("xacro:") or any("${" in value for value in element.attrib.values())


def _names(root: Element, kind: str, path: Path) -> list[str]:
    names: list[str] = []
    for element in root.findall(kind):
        name = element.get("name", "")
        if not name:
            raise ArmError(f"{path}: a <{kind}> has no name; each must have one of its own")
        if not name.isprintable():
            raise ArmError(
                f"{path}: {kind} {name[:40]!r}: a name of characters that cannot be shown; rename it"
            )
        if len(name) > _LONGEST_NAME:
            raise ArmError(
                f"{path}: {kind} {name[:20]!r}...: a name of {len(name)} characters; give at most {_LONGEST_NAME}"
            )
        names.append(name)
    if len(names) > _MOST_ELEMENTS:
        raise ArmError(f"{path}: {len(names)} <{kind}> elements; at most {_MOST_ELEMENTS} are supported")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ArmError(f"{path}: {kind} {twice[0]!r} is declared twice; names must be unique")
    return names


def as_of_a_body(link: Element) -> None:
    """Change a checked link's <inertial> to the nearest that a body has, in place; most have one.

    Without mass there is no inertia, a link that never moves needs none, and no principal moment is above the sum of the
    others: Drake would put a ball of water in the place of what misses this by the rounding of its digits alone.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    assert mass is not None
    if float(mass.get("value", "0")) == 0 or tensor is None:
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


def _check_tree(root: Element, path: Path) -> None:
    """Raise `ArmError` where joints close a loop: a serial arm is a tree."""
    before: dict[str, str] = {}
    for joint in root.findall("joint"):
        name, (parent, child) = joint.get("name", ""), _links(joint)
        if parent == child:
            raise ArmError(f"{path}: joint {name!r} joins link {child!r} to itself")
        if child in before:
            raise ArmError(
                f"{path}: link {child!r} is the child of two joints, {before[child]!r} and {name!r}; an arm has no loop"
            )
        before[child] = name
    above = {child: parent for parent, child in map(_links, root.findall("joint"))}
    for link in above:
        way = [link]
        while (upper := above.get(way[-1])) is not None:
            if upper == link:
                loop = ", ".join(repr(before[each]) for each in reversed(way))
                raise ArmError(f"{path}: joints {loop} form a loop; an arm has none")
            if upper in way:
                break
            way.append(upper)


def _never_moved(root: Element) -> set[str]:
    """Names of the links that fixed joints alone hold to a base: no torque feels their inertia."""
    still = set(base_links(root))
    fixed = [_links(joint) for joint in root.findall("joint") if joint.get("type") == "fixed"]
    while found := {child for parent, child in fixed if parent in still} - still:
        still |= found
    return still


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
        if joint.get("name") not in way and joint.get("type") in MOVING:
            _fix(joint, 0.0, path)


def _say_beyond(joint: Element, value: float, where: str) -> None:
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return
    lower, upper = float(limit.get("lower", "-inf")), float(limit.get("upper", "inf"))
    if not lower <= value <= upper:
        warn(f"{where} is outside of the joint's limits, {lower:g} to {upper:g}")


def _fix(joint: Element, value: float, path: Path) -> None:
    """Make a joint a fixed one at a position; what it can do no more is taken out."""
    where = f"{path}: joint {joint.get('name')!r}"
    origin, axis = joint.find("origin"), joint.find("axis")
    direction = np.array([1.0, 0.0, 0.0]) if axis is None else three(axis, "xyz", f"{where}: <axis>")
    direction = direction / np.linalg.norm(direction)
    xyz, rpy = np.zeros(3), np.zeros(3)
    if origin is not None:
        xyz, rpy = three(origin, "xyz", where), three(origin, "rpy", where)
        joint.remove(origin)
    R = _rotation(rpy)
    if joint.get("type") == "prismatic":
        xyz = xyz + value * (R @ direction)
    else:
        R = R @ rotation_about(direction, value)
    for key in ("axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"):
        for element in joint.findall(key):
            joint.remove(element)
    joint.set("type", "fixed")
    place = {
        "xyz": " ".join(f"{x:.17g}" for x in xyz),
        "rpy": " ".join(f"{x:.17g}" for x in roll_pitch_yaw(R)),
    }
    joint.append(ElementTree.Element("origin", place))


def _rotation(rpy: Array) -> Array:
    """URDF's fixed-axis roll, pitch and yaw: Rz(yaw) Ry(pitch) Rx(roll)."""
    x, y, z = (rotation_about(axis, angle) for axis, angle in zip(np.eye(3), rpy, strict=True))
    return z @ y @ x


def rotation_about(axis: Array, angle: Array | float) -> Array:
    """(..., 3, 3) rotation about a unit axis (3,) by angles (...) (Rodrigues)."""
    K = cross_matrix(axis)
    s, c = np.sin(angle), np.cos(angle)
    return np.asarray(np.eye(3) + np.multiply.outer(s, K) + np.multiply.outer(1 - c, K @ K))


def cross_matrix(axis: Array) -> Array:
    """(3, 3) matrix of the cross product with an axis."""
    x, y, z = axis
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def roll_pitch_yaw(R: Array) -> Array:
    """(3,) angles with R = R_z(yaw) R_y(pitch) R_x(roll); at a pitch of 90° the roll is taken to be zero."""
    across = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = np.arctan2(-R[2, 0], across)
    if across > 1e-12:
        return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])
    return np.array([0.0, pitch, np.arctan2(-R[0, 1], R[1, 1])])


def _listed(names: list[str]) -> str:
    return ", ".join(names[:12]) + (" ..." if len(names) > 12 else "") or "none"


def base_links(root: Element) -> Iterator[str]:
    """Names of the links that are no joint's child; ``world`` for one that is welded or jointed to it undeclared."""
    names = [link.get("name", "") for link in root.findall("link")]
    parents = {child: parent for parent, child in map(_links, root.findall("joint"))}
    yield from (name for name in names if name not in parents)
    if "world" in parents.values() and "world" not in names:
        yield "world"
