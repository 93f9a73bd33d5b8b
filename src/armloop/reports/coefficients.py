"""Tables of a model's coefficients with their standard errors."""

from __future__ import annotations

from scipy.stats import t as student

from armloop.model import ReconstructedModel
from armloop.reports.tables import Table, make_table
from armloop.reports.words import MISSING, number, with_error

_STRIBECK = {"static": "f_s", "coulomb": "f_c", "viscous": "f_v", "stribeck_velocity": "v_s"}
NOTE = (
    "± is one standard error, from leaving out blocks of samples one after the other, so that errors may be "
    "correlated within a block, and from leaving out logs where these differ by more than chance; the interval is that of "
    "Student's t for 95 %. The terms are taken as given: that the "
    "same data chose them, terms that are missing and noise in the motion are not part of it."
)


def coefficients_table(model: ReconstructedModel, title: str | None = "Coefficients") -> Table | None:
    """Every term's coefficient, standard error, t and 95 % interval; None for a model without standard errors.

    Terms that serve all joints stand first, without a joint.
    """
    errors = model.uncertainty
    if not errors:
        return None
    shared, groups = _shared_values(model), errors.get("undetermined", [])
    # joint (from 1) and name of the coefficients that the training data do not tell from others
    lost = {(group["joint"], name) for group in groups for name in group["coefficients"]}
    rows: list[list[object]] = [
        ["", name, *_cells(shared[name], entry, (None, name) in lost)]
        for name, entry in errors["shared"].items()
        if name in shared
    ]
    for j in range(model.arm.n):
        values = {name: c for component in model.components for _, c, name in component.terms(model.arm, j)}
        values |= {term.name(j + 1): term.coefficient for term in model.friction.terms[j]}
        entries = {**errors["joints"][j], **errors["friction"][j]}
        rows += [
            [j + 1, name, *_cells(values[name], e, (j + 1, name) in lost)]
            for name, e in entries.items()
            if name in values
        ]
    for group in groups:
        rows += [
            [group["joint"] or "", one["sum"], with_error(one["value"], one["std_error"]), *[MISSING] * 3]
            for one in group["sums"]
        ]
    headers = ["joint", "term", "value ± error", "t", "95 % interval", "degrees of freedom"]
    return make_table(headers, rows, title, left=(0, 1))


def stribeck_table(model: ReconstructedModel) -> Table | None:
    """f_s, f_c, f_v and v_s of every joint with standard errors, what its law determines of them; None without any."""
    found = model.uncertainty.get("stribeck", [])
    if not any(found):
        return None
    headers = ["joint", *_STRIBECK.values()]
    rows = [
        [
            j + 1,
            *(with_error(e[key]["value"], e[key]["std_error"]) if key in e else MISSING for key in _STRIBECK),
        ]
        for j, e in enumerate(found)
    ]
    return make_table(headers, rows, "Friction, Eq. (34), SI units")


def _shared_values(model: ReconstructedModel) -> dict[str, float]:
    for component in model.components:
        data = component.to_dict()
        if "base_parameters" in data:
            return dict(data["base_parameters"])
        if data["kind"] == "lagrangian":
            return {row["term"]: row["coefficient"] for row in data["terms"]}
    return {}


def _cells(value: float, entry: dict[str, float], lost: bool) -> list[str]:
    if lost:
        return ["not determined", *[MISSING] * 3]
    error, freedom = entry["std_error"], entry["degrees_of_freedom"]
    half = error * float(student.ppf(0.975, freedom))
    ratio = number(value / error) if error > 0 else MISSING
    interval = f"{number(value - half)} … {number(value + half)}"
    return [with_error(value, error), ratio, interval, number(freedom)]
