"""Tables of a diagnosis: effects and events, errors, and what a controller changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armloop.diagnosis import probability
from armloop.laws.effects.found import RANGE
from armloop.laws.effects.listed import listed
from armloop.reports.findings import (
    all_added,
    blame,
    confounded,
    findings,
    judged_apart,
    nothing_to_supply,
    reasons,
)
from armloop.reports.tables import Table, make_table
from armloop.reports.words import MISSING, effect_label, percent, unit, vector, with_error, wrapped

if TYPE_CHECKING:
    from armloop.diagnosis import Closing, Diagnosis
    from armloop.laws.effects import Estimate
    from armloop.robot.arm import Arm

#: Parameters that say when something was, which the sentences tell.
_WHEN = ("picked_up", "put_down", "posture")


def effects_table(diagnosis: Diagnosis) -> Table:
    """Each effect found with its parameters ± standard error, its share of the explainable residual, and where it is."""
    rows: list[list[object]] = []
    every = zip(diagnosis.outcome.found, diagnosis.outcome.added(), diagnosis.strengths, strict=True)
    for found, added, strength in every:
        chance = probability.of_effect(found.share, strength.times) if listed(found.effect) else None
        known = {key: e for key, e in added.parameters.items() if key not in _WHEN}
        for k, (key, e) in enumerate(known.items()):
            first = [effect_label(found.effect), "sensor" if found.effect.sensor else "arm"]
            label, where = first if k == 0 else ["", ""]
            share, likely = (percent(found.share), percent(chance)) if k == 0 else ("", "")
            value = with_error(e.value, e.std_error)
            rows.append([label, key.replace("_", " "), value, unit(e.unit), share, likely, where])
        onset = found.effect.onset
        if onset is not None:
            for word, instant in onset.instants:
                rows.append(["", word, with_error(instant, onset.error), "s", "", "", ""])
    for law in diagnosis.laws:
        label = f"unlisted, joint {law.joint}"
        terms = [(k, e) for k, e in law.parameters.items() if k not in RANGE]
        for k, (key, e) in enumerate(terms):
            likely = "" if k else percent(probability.UNLISTED.probability)
            rows.append(
                ["" if k else label, key, with_error(e.value, e.std_error), unit(e.unit), "", likely, ""]
            )
        if not terms:
            rows.append([label, "law", MISSING, "", "", percent(probability.UNLISTED.probability), ""])
    headers = ["effect", "parameter", "value ± std. error", "unit", "share", "probability", "where"]
    return make_table(headers, rows, "Effects found", left=(0, 1, 3, 6))


def events_table(diagnosis: Diagnosis) -> Table:
    """Each event's interval, where it acted, and its mean: a force in the base frame, or the torque the drive supplied."""
    rows = []
    for k, contact in enumerate(diagnosis.contacts):
        p, joint = contact.added.parameters, contact.added.effect.joint
        size = p["force"] if joint is None else p["torque"]
        value = np.atleast_1d(np.asarray(size.value, dtype=float))
        where = "beyond the last link" if "point" in p else "tool"
        where = f"link {_rounded(p['link'], 0, 1)}" if "link" in p else where
        rows.append(
            [
                k + 1,
                *(_rounded(p[key], 2, 2) for key in ("start", "end")),
                where if joint is None else f"joint {joint}",
                float(np.linalg.norm(value)),
                unit(size.unit),
                vector(value.tolist()),
                vector(np.atleast_1d(np.asarray(size.std_error, dtype=float)).tolist(), 2),
                percent(contact.share),
            ]
        )
    headers = ["event", "from [s]", "to [s]", "at", "mean", "unit", "(x, y, z)", "std. error", "explains"]
    return make_table(headers, rows, "Events", left=(3, 5))


def _rounded(of: Estimate, places: int, of_error: int) -> str:
    """A value and its error, each to so many decimal places."""
    value, error = (float(np.asarray(x)) for x in (of.value, of.std_error))
    return f"{value:.{places}f} ± {error:.{of_error}f}"


def errors_table(diagnosis: Diagnosis) -> Table:
    """RMSE per joint before and after the effects were added, and the model's own on its baseline data."""
    errors = diagnosis.errors()
    relative = errors["nrmse"]
    rows = [
        [
            f"{j + 1}  {joint.name}",
            unit(errors["unit"][j]),
            *(errors[key][j] for key in ("before", "after", "noise_floor")),
            *(percent(relative[key][j]) for key in ("before", "after")),
        ]
        for j, joint in enumerate(diagnosis.model.arm.joints)
    ]
    headers = ["joint", "unit", "before", "after", "baseline", "nRMSE before", "nRMSE after"]
    return make_table(headers, rows, "Residual on data judged but not fitted, RMSE", left=(0, 1))


def feedforward_table(diagnosis: Diagnosis, compensation: Closing) -> Table:
    """RMS and largest change of the feedforward along the run, beside the RMS torque measured."""
    change = compensation.feedforward
    measured = np.sqrt(np.mean(diagnosis.samples.tau**2, axis=0))
    rows = [
        [
            f"{j + 1}  {joint.name}",
            unit(joint.torque_unit),
            change.rms[j],
            change.largest[j],
            measured[j],
            percent(change.rms[j] / measured[j]) if measured[j] else None,
        ]
        for j, joint in enumerate(diagnosis.model.arm.joints)
    ]
    headers = ["joint", "unit", "RMS", "largest", "RMS measured", "of it"]
    return make_table(headers, rows, "Torque that the controller now adds", left=(0, 1))


def held_out_table(compensation: Closing, arm: Arm) -> Table:
    """RMSE and nRMSE per run and joint, of the model before and the augmented one."""
    rows: list[list[object]] = []
    for run in compensation.held_out:
        old, new = run.before.moving, run.after.moving
        for j, joint in enumerate(arm.joints):
            rows.append(
                [
                    run.name if j == 0 else "",
                    f"{j + 1}  {joint.name}",
                    unit(joint.torque_unit),
                    old["rmse"][j],
                    new["rmse"][j],
                    percent(old["nrmse"][j]),
                    percent(new["nrmse"][j]),
                ]
            )
    headers = ["run", "joint", "unit", "before", "after", "nRMSE before", "nRMSE after"]
    return make_table(headers, rows, "Whole runs that were not fitted, RMSE", left=(0, 1, 2))


def found_tables(diagnosis: Diagnosis) -> list[Table]:
    """Effects and events, where there are any, and the errors per joint."""
    effects = diagnosis.outcome.found or diagnosis.unlisted is not None
    tables = [effects_table(diagnosis)] if effects else []
    tables += [events_table(diagnosis)] if diagnosis.contacts else []
    return [*tables, errors_table(diagnosis)]


def compensation_tables(diagnosis: Diagnosis, compensation: Closing) -> list[Table]:
    """What a controller adds, where it does, and errors on whole runs that were not fitted, where there are any."""
    tables = [feedforward_table(diagnosis, compensation)] if compensation.feedforward.largest.any() else []
    return [*tables, *([held_out_table(compensation, diagnosis.model.arm)] if compensation.held_out else [])]


def diagnosis_table(diagnosis: Diagnosis, compensation: Closing | None = None) -> str:
    """The verdict, what was found, the errors per joint, and what a controller changes, for a terminal."""
    sentences = [*findings(diagnosis), *reasons(diagnosis), *blame(diagnosis)]
    verdict = diagnosis.verdict.replace("_", " ")
    parts = [f"Verdict: {verdict}", "\n".join(map(wrapped, sentences))]
    parts += map(str, found_tables(diagnosis))
    for found, alike in confounded(diagnosis):
        lines = [wrapped(f"- {other}: {why}") for other, why in alike]
        parts.append("\n".join([f"This motion cannot tell {found} from", *lines]))
    if compensation is not None:
        if not compensation.feedforward.largest.any():
            parts.append(nothing_to_supply(all_added(diagnosis)))
        parts += map(str, compensation_tables(diagnosis, compensation))
    for other in diagnosis.apart:
        parts.append("\n".join([judged_apart(other), *map(wrapped, findings(other))]))
    return "\n\n".join(parts)
