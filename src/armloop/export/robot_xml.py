"""An arm as XML by the templates of its formats: URDF, SDFormat and MJCF, in SI units, numbers to the last digit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from scipy.spatial.transform import Rotation

from armloop import __version__
from armloop.export.expressible import Said, body_of
from armloop.robot.arm import Joint
from armloop.robot.urdf import roll_pitch_yaw
from armloop.util.arrays import Array

#: Stands for no limit, rad (m), where a format takes both or none; beyond what is read as a limit.
_FAR = 1e7
URDF_FEATURES = frozenset({"damping"})
SDF_FEATURES = frozenset({"damping", "spring"})


def urdf_text(said: Said) -> str:
    """The arm as URDF. Drake reads damping and its own tags for the rotors, and drops friction."""
    return described(said, "arm.urdf")


def sdf_text(said: Said) -> str:
    """The arm as SDFormat. Drake reads damping, springs and its own tags for the rotors, and drops friction."""
    return described(said, "arm.sdf")


def described(said: Said, template: str) -> str:
    """The arm by one of the templates."""
    bodies = []
    for parameters in said.links.reshape(-1, 10):
        mass, com, J = body_of(parameters)
        inertia = {f"i{'xyz'[a]}{'xyz'[b]}": J[a, b] for a, b in zip(*np.triu_indices(3), strict=True)}
        bodies.append((mass, com, inertia))
    has_tool = not np.allclose(said.arm.X_tool, np.eye(4), atol=0)
    return _TEMPLATES.get_template(template).render(
        said=said, arm=said.arm, bodies=bodies, has_tool=has_tool, version=__version__
    )


def _numbers(values: Array) -> str:
    return " ".join(map(str, values.tolist()))


def _ends(joint: Joint) -> list[tuple[str, float]]:
    ends = ((key, getattr(joint, key)) for key in ("lower", "upper", "effort", "velocity"))
    return [(key, value) for key, value in ends if np.isfinite(value)]


_FILTERS: dict[str, Callable[[Any], object]] = {
    "comment": lambda text: Markup(text.replace("--", "- -")),  # cannot end a comment
    "numbers": _numbers,
    "xyz": lambda X: _numbers(X[:3, 3]),
    "rpy": lambda X: _numbers(roll_pitch_yaw(X[:3, :3])),
    "quaternion": lambda X: _numbers(Rotation.from_matrix(X[:3, :3]).as_quat(scalar_first=True)),
    "reach": lambda X: float(np.linalg.norm(X[:3, 3])),
    "ends": _ends,
    "end": lambda limit: float(np.clip(limit, -_FAR, _FAR)),
}
_TESTS: dict[str, Callable[[Any], object]] = {
    "finite": np.isfinite,
    "limited": lambda joint: np.isfinite([joint.lower, joint.upper]).any(),
}
_TEMPLATES = Environment(
    loader=PackageLoader("armloop.export"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_TEMPLATES.filters |= _FILTERS
_TEMPLATES.tests |= _TESTS
