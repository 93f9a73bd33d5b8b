"""What a URDF's links and joints must be, element by element, and what is doubtful about them.

What a parser would take silently (a mass of ``1kg``, an inertia that no body has, one of two masses), or answer with a
traceback, is answered with one line that names the file and the element.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections import Counter

import numpy as np

from armloop.schemas.types import FARTHEST, HEAVIEST
from armloop.util.arrays import Array
from armloop.util.doubts import warn
from armloop.util.errors import ArmError

Element = ElementTree.Element

#: Types of joints that move.
MOVING = ("revolute", "continuous", "prismatic")
# Limits beyond these are none: rad or m, and everything else.
_LARGEST = {"lower": 1e6, "upper": 1e6}
_LARGEST_ELSE = 1e12
# Principal moments may miss the triangle inequality by so much of the largest before it is said: rounding in CAD.
_TRIANGLE = 0.01
# A link of an arm is no larger, m; no angle of a frame is beyond, rad; limits between these, rad, may be degrees.
_FAR, _TURN, _DEGREES = 10.0, 7.0, (30.0, 720.0)
# A link with a mass is no smaller, m: what is left of its inertia below this is rounding.
_SPECK = 1e-6
_LIMITS = ("lower", "upper", "velocity", "effort")
# Children of which an element has one at most.
_ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic"),
}


def check_link(link: Element, where: str, moves: bool = True) -> None:
    """Raise `ArmError` where the inertia of a link that ``moves`` cannot be; ``where`` names file and link."""
    _check_once(link, where)
    inertial = link.find("inertial")
    if inertial is None:
        return  # a frame without a body
    _check_once(inertial, where)
    _check_origin(inertial, where)
    element = inertial.find("mass")
    if element is None:
        raise ArmError(f"{where}: <inertial> has no <mass>; give its value in kg")
    mass = number(element, "value", f"{where}: <mass>")
    if not 0 <= mass <= HEAVIEST:
        raise ArmError(f"{where}: <mass> value={mass:g} must be from 0 to {HEAVIEST:g}; give kg")
    element = inertial.find("inertia")
    if element is None:
        wrong = f"{where}: <inertial> has no <inertia>"
        if moves:
            raise ArmError(f"{wrong}; give ixx, iyy, izz (and ixy, ixz, iyz) in kg·m²")
        warn(f"{wrong}, but this link never moves")
        return
    diagonal = [number(element, key, f"{where}: <inertia>") for key in ("ixx", "iyy", "izz")]
    ixy, ixz, iyz = (
        number(element, key, f"{where}: <inertia>") if key in element.attrib else 0.0
        for key in ("ixy", "ixz", "iyz")
    )
    tensor = np.diag(diagonal) + np.array([[0, ixy, ixz], [ixy, 0, iyz], [ixz, iyz, 0]])
    if np.abs(tensor).max() > _LARGEST_ELSE:
        raise ArmError(f"{where}: <inertia> holds {np.abs(tensor).max():g}; give kg·m²")
    least, middle, most = np.linalg.eigvalsh(tensor)
    rounding = mass * _SPECK**2
    if least < -max(1e-9 * most, rounding):
        wrong = f"{where}: <inertia> is not positive definite: a principal moment is {least:.4g} kg·m²; no body has it"
        if moves:
            raise ArmError(wrong)
        warn(f"{wrong}, but this link never moves")
    elif mass == 0 and most > 0:
        warn(
            f"{where}: <mass> is zero with an <inertia>, which no body has; the link is taken for one without either"
        )
    elif mass > 0 and most <= rounding:
        warn(f"{where}: <inertia> is zero with a mass of {mass:g} kg; it is taken for a point")
    elif mass > 0 and np.sqrt(most / mass) > _FAR:
        warn(
            f"{where}: <inertia> of {most:.4g} kg·m² with a mass of {mass:g} kg, as of a body that reaches "
            f"{np.sqrt(most / mass):.3g} m; give kg·m²"
        )
    elif least + middle < most * (1 - _TRIANGLE):
        warn(
            f"{where}: <inertia> has principal moments {least:.4g}, {middle:.4g}, {most:.4g} kg·m²; of a body, two add "
            "up to at least the third, which is taken to be their sum"
        )


def check_joint(joint: Element, links: list[str], where: str) -> None:
    """Raise `ArmError` where a joint cannot be; ``where`` names file and joint."""
    kind = joint.get("type")
    _check_once(joint, where)
    for end in ("parent", "child"):
        element = joint.find(end)
        name = None if element is None else element.get("link")
        if name is None:
            raise ArmError(f"{where} has no <{end} link=...>; name the link")
        if name not in links and not (end == "parent" and name == "world"):
            raise ArmError(f"{where}: {end} link {name[:40]!r} is not declared")
    _check_origin(joint, where)
    if kind not in (*MOVING, "fixed"):
        raise ArmError(f"{where}: type {str(kind)[:40]!r}; it must be one of {', '.join(MOVING)}, fixed")
    if kind == "fixed":
        for element in joint.findall("mimic"):  # left there by who fixed a gripper; parsers refuse it
            joint.remove(element)
        return
    for dynamics in joint.findall("dynamics"):
        for key in {"damping", "friction"} & set(dynamics.attrib):
            if number(dynamics, key, f"{where}: <dynamics>") < 0:
                raise ArmError(f"{where}: <dynamics> {key}={dynamics.get(key)} must not be negative")
    axis = joint.find("axis")
    if axis is not None and not np.linalg.norm(three(axis, "xyz", f"{where}: <axis>")) > 1e-9:
        raise ArmError(f"{where}: <axis> has no length; give a direction such as '0 0 1'")
    limit = joint.find("limit")
    if limit is None:
        return
    values = {}
    for key in _LIMITS:
        if (text := limit.get(key, "").strip().lower()).lstrip("+-") in ("inf", "infinity"):
            values[key] = float(text)
            del limit.attrib[key]
    if all(key in limit.attrib and number(limit, key, f"{where}: <limit>") == 0 for key in _LIMITS):
        warn(f"{where}: <limit> is zero throughout, as where an export leaves it empty; it is taken for none")
        for key in _LIMITS:
            del limit.attrib[key]
    for key in _LIMITS:
        if key in limit.attrib:
            values[key] = number(limit, key, f"{where}: <limit>")
            if abs(values[key]) > _LARGEST.get(key, _LARGEST_ELSE):
                warn(f"{where}: <limit> {key}={values[key]:g} is taken for none")
                values[key] = np.copysign(np.inf, values[key])
                del limit.attrib[key]
    if values.get("velocity", 1.0) < 0:
        raise ArmError(
            f"{where}: <limit> velocity={values['velocity']:g} must be positive; leave it out if unknown"
        )
    if values.get("velocity") == 0:
        warn(f"{where}: <limit> velocity=0 is taken for unknown, as where an export leaves it empty")
        del limit.attrib["velocity"]
    if values.get("effort", 0.0) < 0:
        raise ArmError(f"{where}: <limit> effort={values['effort']:g} must not be negative")
    lower, upper = values.get("lower", -np.inf), values.get("upper", np.inf)
    if kind != "continuous" and lower > upper:
        raise ArmError(f"{where}: <limit> lower={lower:g} is above upper={upper:g}; exchange them")
    if kind != "continuous" and lower == upper:
        raise ArmError(
            f"{where}: <limit> lower={lower:g} is not below upper={upper:g}; lock a joint that does not move "
            f"(--lock {joint.get('name')}={lower:g})"
        )
    if kind == "revolute" and _DEGREES[0] < max(abs(lower), abs(upper)) <= _DEGREES[1]:
        warn(f"{where}: <limit> lower={lower:g}, upper={upper:g} rad are many turns; are they degrees?")


def number(element: Element, key: str, where: str) -> float:
    """One finite number of an attribute that must be there; ``where`` names file and element."""
    text = element.get(key)
    if text is None:
        raise ArmError(f"{where} has no {key}; give a number")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not text.isascii() or "_" in text or not np.isfinite(value):
        raise ArmError(
            f"{where} {key}={text[:40]!r} is not a finite number; write it like 0.25, without a unit"
        )
    return value


def three(element: Element, key: str, where: str) -> Array:
    """Three finite numbers of an attribute, zeros where it is not there."""
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
    """Raise `ArmError` for an origin that is no place, and say it where it is one that no arm's is."""
    for origin in element.findall("origin"):
        xyz, rpy = (three(origin, key, f"{where}: <origin>") for key in ("xyz", "rpy"))
        if np.abs(xyz).max() > FARTHEST:
            raise ArmError(
                f"{where}: <origin> xyz='{origin.get('xyz')}' is {np.linalg.norm(xyz):.3g} m away, as no part of an arm is; "
                "give m"
            )
        if np.abs(xyz).max() > _FAR:
            warn(f"{where}: <origin> xyz='{origin.get('xyz')}' is {np.linalg.norm(xyz):.3g} m away; give m")
        if np.abs(rpy).max() > _TURN:
            warn(f"{where}: <origin> rpy='{origin.get('rpy')}' turns by more than all round; give rad")


def _check_once(element: Element, where: str) -> None:
    """Raise `ArmError` where one of two elements would be taken."""
    counts = Counter(child.tag for child in element)
    for tag in _ONCE[element.tag]:
        if counts[tag] > 1:
            raise ArmError(f"{where}: {counts[tag]} elements <{tag}>; a <{element.tag}> has one")
