"""Validation of a model file: migration of ``armloop/model/1``, and whether fields, each right in itself, agree."""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec import UNSET

from armloop.schemas.checking import Misfit, checked
from armloop.schemas.model import (
    SCHEMA,
    ArmData,
    LagrangianData,
    ModelData,
    SpellsOfLogsData,
    TermsData,
)
from armloop.schemas.types import FARTHEST, HEAVIEST
from armloop.util.errors import ModelError

#: Relative error of what a file of decimal numbers may have lost.
_ROUNDED = 1e-6


def _from_1(data: dict[str, Any]) -> dict[str, Any]:
    """``armloop/model/1`` knew models without standard errors."""
    return {"uncertainty": {}, **data, "schema": "armloop/model/2"}


#: Schema: what makes the next one of it.
_MIGRATIONS = {"armloop/model/1": _from_1}


def _other(schema: Any) -> str:
    """What is wrong with a schema that is not this one."""
    kind, _, number = schema.rpartition("/") if isinstance(schema, str) else ("", "", "")
    here, _, mine = SCHEMA.rpartition("/")
    if kind == "armloop/diagnosis":
        return f"it must be {SCHEMA!r}; the model of a diagnosis lies beside it, in model.json"
    if kind == here and number.isdecimal() and int(number) > int(mine):
        return f"of a newer armloop; this one reads up to {SCHEMA!r}"
    return f"it must be {SCHEMA!r}"


def model_data(data: Any) -> dict[str, Any]:
    """What was read from a model file, checked, as one of this schema; raises ``ModelError``, which names the field."""
    found = data.get("schema") if isinstance(data, dict) else None
    while isinstance(found, str) and found in _MIGRATIONS:
        data = _MIGRATIONS[found](data)
        found = data["schema"]
    if found != SCHEMA:
        raise ModelError(f"schema is {found!r:.60}, {_other(found)}")
    try:
        model = checked(data, ModelData)
    except Misfit as misfit:
        raise ModelError(str(misfit)) from None
    _agree(model)
    whole: dict[str, Any] = data
    return whole


def _agree(model: ModelData) -> None:
    """Raise ``ModelError`` where lengths do not go with the number of joints."""
    arm, n = model.arm, len(model.arm.joints)
    history, zeros = model.history, model.history.encoder_zeros
    ranges = [] if history.range is UNSET else history.range
    lengths: list[tuple[str, Any]] = [
        *((f"arm.{key}", getattr(arm, key)) for key in ("X_PF", "axis", "mass", "com", "inertia")),
        ("friction", model.friction),
        ("recorded.drive_gains", model.recorded.drive_gains),
        *(
            (f"baseline.{key}", getattr(model.baseline, key))
            for key in ("rmse", "rms", "nrmse", "worst", "reversals", "creeping")
        ),
        ("baseline.joints", model.baseline.joints or UNSET),  # without parts there are none
        *(
            (f"baseline.null: removed of {law.effect!r:.60}", law.removed)
            for law in model.baseline.null or ()
        ),
        *((f"history.range[{k + 1}]", row) for k, row in enumerate(ranges)),
        ("history.slowest", history.slowest),
        ("history.velocity_noise", history.velocity_noise),
        ("history.encoder_zeros.spread", UNSET if zeros is UNSET else zeros.spread),
        *(
            (f"uncertainty.{key}", getattr(model.uncertainty, key) or None)
            for key in ("joints", "friction", "stribeck", "between_logs", "sensor_drift")
        ),
    ]
    for part in model.components:
        if isinstance(part, TermsData):
            lengths.append((f"terms of step {part.step}", part.joints))
        elif isinstance(part, LagrangianData):
            lengths += [(f"lagrangian: degrees of {term.term!r:.60}", term.degrees) for term in part.terms]
        else:
            if len(part.parameters) not in (10 * n, 11 * n):
                raise ModelError(
                    f"rigid_body: {len(part.parameters)} parameters, {n} links need {10 * n} or {11 * n}"
                )
            for k, mass in enumerate(part.parameters[: 10 * n : 10]):
                if abs(mass) > HEAVIEST:
                    raise ModelError(
                        f"rigid_body: the mass of link {k + 1} is {mass:g} kg; no link has more than {HEAVIEST:g}"
                    )
    for place, values in lengths:
        if values is not None and values is not UNSET and len(values) != n:
            raise ModelError(f"{place}: {len(values)} joints, the arm has {n}")
    if any(x < 0 for row in ranges[:3] for x in row):
        raise ModelError("history.range: half ranges, velocities and accelerations must not be negative")
    if history.inertial is not UNSET and len(history.inertial) != 10 * n:
        raise ModelError(f"history.inertial: {len(history.inertial)} parameters, {n} links have {10 * n}")
    _check_arm(arm)
    _check_sums(model)
    for kept_errors in model.uncertainty.torque:
        numbers = [len(row.split()) for row in kept_errors.directions]
        if numbers != [min(k + 1, max(numbers, default=0)) for k in range(len(kept_errors.unknowns))]:
            raise ModelError(
                "uncertainty.torque: directions must be one row for each of the unknowns, each a number longer than the "
                "one before, up to the same length"
            )
    for k, effect in enumerate(model.effects):
        times = [word for word in ("since", "until", "during") if getattr(effect, word) is not UNSET]
        if len(times) > 1:
            raise ModelError(f"effects[{k + 1}]: has {' and '.join(times)}; give one of them, or none")
        if effect.during is not UNSET:
            _check_spells(effect.during, n, f"effects[{k + 1}].during")
        for word, onset in (("since", effect.since), ("until", effect.until)):
            if onset is not UNSET and len(onset.posture) != n:
                raise ModelError(
                    f"effects[{k + 1}].{word}.posture: {len(onset.posture)} joints, the arm has {n}"
                )
        for joint_number in (effect.joint, effect.other_joint):
            if joint_number is not None and joint_number > n:
                raise ModelError(
                    f"effects[{k + 1}]: effect {effect.effect!r:.60} is on joint {joint_number}; the arm has "
                    f"joints 1 to {n}"
                )
        for name, each in effect.parameters.items():
            sizes = {
                len(x) if isinstance(x, list) else 0 for x in (each.value, each.std_error) if x is not None
            }
            if len(sizes) > 1:
                raise ModelError(f"effects[{k + 1}]: {name}: value and std_error are not of one length")


def _check_spells(during: SpellsOfLogsData, n: int, place: str) -> None:
    """Raise ``ModelError`` where intervals of an effect are none, or of another arm."""
    counts = {len(during.start), len(during.end), len(during.posture), len(during.log or during.start)}
    if len(counts) > 1 or any(b <= a for a, b in zip(during.start, during.end, strict=False)):
        raise ModelError(
            f"{place}: each end must come after its start, as many of them, of postures and of logs"
        )
    for posture in during.posture:
        if len(posture) != n:
            raise ModelError(f"{place}.posture: {len(posture)} joints, the arm has {n}")


def _check_arm(arm: ArmData) -> None:
    """Raise ``ModelError`` where numbers of an arm, each right in itself, are no arm's together."""
    poses = {f"arm.X_PF[{k + 1}]": np.array(pose) for k, pose in enumerate(arm.X_PF)}
    poses["arm.X_tool"] = np.array(arm.X_tool)
    for place, X in poses.items():
        x, y, z = X[:3, :3]
        turned = np.concatenate([[x @ x - 1, y @ y - 1, x @ y], np.cross(x, y) - z])
        if np.abs(turned).max() > _ROUNDED or X[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise ModelError(f"{place} is no pose: a rotation and a place (m) above a row 0, 0, 0, 1")
    for k, axis in enumerate(arm.axis):
        if abs(np.dot(axis, axis) - 1.0) > _ROUNDED:
            raise ModelError(f"arm.axis[{k + 1}] is {axis}; an axis must have the length 1")
    for k, inertia in enumerate(map(np.array, arm.inertia)):
        rounded = _ROUNDED * np.abs(inertia).max()
        if np.abs(inertia - inertia.T).max() > rounded or (np.diag(inertia) < -rounded).any():
            raise ModelError(
                f"arm.inertia[{k + 1}] is no inertia: it must be symmetric, and no moment negative"
            )
    for k, mass in enumerate(arm.mass):
        if not 0 <= mass <= HEAVIEST:
            raise ModelError(f"arm.mass[{k + 1}] is {mass:g}; a mass must be from 0 to {HEAVIEST:g} kg")
    places = {f"arm.com[{k + 1}]": np.array(com) for k, com in enumerate(arm.com)}
    for name, xyz in (places | {name: X[:3, 3] for name, X in poses.items()}).items():
        farthest = np.abs(xyz).max()
        if farthest > FARTHEST:
            raise ModelError(f"{name} lies {farthest:g} m away, as no part of an arm does; give m")
    if not arm.name.isprintable():
        raise ModelError(f"arm.name is {arm.name!r:.60}, which cannot be shown; give it a name of its own")
    names = [joint.name for joint in arm.joints]
    for k, name in enumerate(names):
        if not name.strip() or name in names[:k] or not name.isprintable():
            fault = (
                "is used twice"
                if name in names[:k]
                else "is empty"
                if not name.strip()
                else "cannot be shown"
            )
            raise ModelError(
                f"arm.joints[{k + 1}].name is {name!r:.60}, which {fault}; give each joint a name of its own"
            )
    for joint in arm.joints:
        low = float("-inf") if joint.lower is UNSET else joint.lower
        high = float("inf") if joint.upper is UNSET else joint.upper
        if not low < high:
            raise ModelError(
                f"arm: joint {joint.name!r:.60} goes from {low:g} to {high:g}; give lower below upper"
            )


def _check_sums(model: ModelData) -> None:
    """Raise ``ModelError`` where a sum has the same part twice: it would count twice."""
    bodies = [part for part in model.components if not isinstance(part, TermsData)]
    steps = [part.step for part in model.components if isinstance(part, TermsData)]
    if len(bodies) > 1 or len(set(steps)) < len(steps):
        raise ModelError(
            "components: one of them stands twice; a sum has one rigid_body or lagrangian, and terms of a step once"
        )
    for k, terms in enumerate(model.friction):
        given = [(term.kind, term.parameter) for term in terms]
        for i, (kind, parameter) in enumerate(given):
            if (kind, parameter) in given[:i]:
                raise ModelError(f"friction[{k + 1}]: {kind!r:.60} of parameter {parameter:g} stands twice")
