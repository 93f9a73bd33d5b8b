"""Comparing verdicts with what was hidden: right, wrong, confused with what, at which size, how far off."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np

from armloop.reports.tables import table

#: The target: where each effect is at least this share of its joint's torque RMS.
LARGE = 0.03
#: A parameter is right within a tenth, or three of its standard errors.
TOLERANCE, ERRORS = 0.1, 3.0
#: Effects that no motion can tell apart: naming one with the other as its alternative is all there is to say.
SAME = ({"torque_offset", "friction_asymmetry"},)

Case = tuple[dict[str, Any], dict[str, Any]]


def place(effect: dict[str, Any]) -> tuple[Any, ...]:
    """Name and joints."""
    return effect["effect" if "effect" in effect else "name"], effect["joint"], effect.get("other_joint")


def _readings(effect: dict[str, Any]) -> set[tuple[Any, ...]]:
    """The places that a found effect stands for: its own, and an alternative that is the same column on any motion."""
    readings = {place(effect)}
    for rival in effect["alternatives"]:
        if any({effect["effect"], rival["effect"]} == pair for pair in SAME):
            readings.add(place(rival))
    return readings


def is_right(hidden: dict[str, Any], verdict: dict[str, Any]) -> bool:
    """Whether exactly what was hidden was found, nothing more and nothing less."""
    found = [effect for effect in verdict["effects"] if effect["effect"] != "unlisted"]
    unlisted = len(found) < len(verdict["effects"])
    if hidden["kind"] == "unlisted":
        return verdict["verdict"] == "unlisted_effect"
    if hidden["kind"] == "event":
        return len(found) == 1 and not unlisted and _meets(hidden["effects"][0], found[0])
    if hidden["kind"] == "clean":
        return verdict["verdict"] == "no_effect"
    if unlisted or len(found) != len(hidden["effects"]):
        return False
    truths = [place(effect) for effect in hidden["effects"]]
    if hidden["kind"] == "carried" and not _carried_then(hidden["effects"][0], found[0]):
        return False
    return all(any(truth in _readings(effect) for effect in found) for truth in truths)


def _meets(event: dict[str, Any], found: dict[str, Any]) -> bool:
    """Whether a found event overlaps the hidden one for most of the shorter; a torque must be at its joint."""
    if found["effect"] not in ("external_contact", "external_torque"):
        return False
    start, end = (found["parameters"][key]["value"] for key in ("start", "end"))
    common = min(end, event["end"]) - max(start, event["start"])
    # What a force on one link does to few joints is a torque at one of them, or a force elsewhere, just as well.
    at = event["name"] == "external_contact" or found["joint"] in (None, event["joint"])
    return bool(at and common >= 0.5 * min(end - start, event["end"] - event["start"]))


def _carried_then(load: dict[str, Any], found: dict[str, Any]) -> bool:
    """Whether a load was carried when it was found to be, but for a tenth of that time; seen ten times a second."""
    if "picked_up" not in found["parameters"]:
        return False
    ends = [np.atleast_1d(found["parameters"][key]["value"]) for key in ("picked_up", "put_down")]
    times = np.arange(0.0, max(b for _, b in load["intervals"]) + 10.0, 0.1)
    truth, stated = (
        np.logical_or.reduce([(times >= a) & (times < b) for a, b in pairs])
        for pairs in (load["intervals"], zip(*ends, strict=True))
    )
    return bool((truth != stated).sum() <= 0.1 * truth.sum())


def is_named(hidden: dict[str, Any], effect: dict[str, Any]) -> bool:
    """Whether one effect of a verdict is, or has as its alternative, one that was hidden; unlisted, that some law was."""
    if effect["effect"] == "unlisted":
        # our own arms have the law beside the listed effects, its joint from 0
        laws = [truth["joint"] for truth in hidden["effects"] if truth["name"] == "unlisted"]
        laws += [hidden["extra"]["joint"] + 1] if hidden.get("extra") else []
        return effect["joint"] in laws
    if hidden["kind"] == "event":
        return _meets(hidden["effects"][0], effect)
    stands_for = {place(effect), *(place(rival) for rival in effect["alternatives"])}
    return any(place(truth) in stands_for for truth in hidden["effects"])


def reliability(cases: Iterable[Case]) -> str:
    """Stated probability against how often what was named was there."""
    stated: dict[float, list[bool]] = {}
    for hidden, verdict in cases:
        for effect in verdict["effects"]:
            if effect.get("probability") is not None:
                stated.setdefault(effect["probability"], []).append(is_named(hidden, effect))
    rows: list[list[object]] = [
        [f"{p:.2f}", len(there), sum(there), f"{np.mean(there):.2f}"] for p, there in sorted(stated.items())
    ]
    return table(["stated probability", "named", "there", "part"], rows, "Reliability of what is stated")


def deviations(hidden: dict[str, Any], verdict: dict[str, Any]) -> list[tuple[str, float, float]]:
    """(name, relative error, error in standard errors) of the parameters of effects that were named rightly."""
    out = []
    for truth in hidden["effects"]:
        for found in verdict["effects"]:
            if place(found) != place(truth):
                continue
            # Arms from outside have an effect's numbers beside its name; a force on a link is none on the tool.
            for key, value in truth.get("parameters", truth).items():
                if key not in found["parameters"] or key in ("phase", "ratio", "order", "force"):
                    continue
                estimate = found["parameters"][key]
                # What the motion does not determine is stated as such, with no error.
                errors = np.atleast_1d(np.array(estimate["std_error"], dtype=float))
                known = np.isfinite(errors)
                off = np.linalg.norm(np.atleast_1d(np.subtract(estimate["value"], value))[known])
                error = float(np.linalg.norm(errors[known]))
                size = float(np.linalg.norm(np.atleast_1d(value)[known]))
                if not known.any():
                    continue
                out.append(
                    (f"{truth['name']}.{key}", float(off) / max(size, 1e-9), float(off) / max(error, 1e-12))
                )
    return out


def of_changes(case: Case) -> Case:
    """The case by what changed alone, if the arm is a measured one: what a model of it lacks all along, nobody knows."""
    hidden, verdict = case
    changed = [effect for effect in verdict["effects"] if effect["when"] != "always"]
    if not hidden.get("measured") or len(changed) == len(verdict["effects"]):
        return case
    named = [effect for effect in changed if effect["effect"] != "unlisted"]
    words = "effects_found" if named else "unlisted_effect" if changed else "no_effect"
    return hidden, {**verdict, "effects": changed, "verdict": words}


def print_verdicts(cases: dict[str, Case]) -> int:
    """Print everything; return 0 if the targets are met."""
    whole, cases = cases, {name: of_changes(case) for name, case in cases.items()}
    lacking = sum(cases[name] is not whole[name] for name in cases)
    if lacking:
        print(
            f"{lacking} runs of measured arms are said to show what their model lacks all along: not judged."
        )
    rows, wrong = [], []
    for name, (hidden, verdict) in sorted(cases.items()):
        if not is_right(hidden, verdict):
            truth = ", ".join(_words(e) for e in hidden["effects"]) or hidden["law"] or "nothing"
            got = ", ".join(_words(e) for e in verdict["effects"]) or verdict["verdict"]
            sizes = ", ".join(f"{100 * s:.1f} %" for s in hidden["sizes"])
            wrong.append([name, truth, sizes, got])
    print(table(["case", "hidden", "size", "verdict"], wrong, "Not judged rightly"))
    met = True
    targets = {
        "one": 0.95,
        "two": 0.85,
        "unlisted": 0.9,
        "event": 0.8,
        "carried": 0.8,
        "stop": 0.9,
        "tendon": 0.9,
        "clean": 0.95,
    }
    for kind, target in targets.items():
        mine = [case for case in cases.values() if case[0]["kind"] == kind]
        if not mine:
            continue
        large = [case for case in mine if min(case[0]["sizes"], default=1.0) >= LARGE]
        right, right_large = (sum(is_right(*case) for case in some) for some in (mine, large))
        share = right_large / len(large) if large else 1.0
        met &= share >= target
        rows.append(
            [
                kind,
                f"{right} of {len(mine)}",
                f"{right_large} of {len(large)}",
                f"{share:.0%}",
                f"{target:.0%}",
            ]
        )
    headers = ["hidden", "right, any size", f"right, size from {LARGE:.0%}", "share", "target"]
    print(table(headers, rows, "Verdicts"))
    print(_by_size(cases))
    print(_by_effect(cases))
    print(_parameters(cases))
    print(reliability(cases.values()))
    return 0 if met else 1


def _words(effect: dict[str, Any]) -> str:
    name, joint, other = place(effect)
    return f"{name} {joint or ''}{f'+{other}' if other else ''}".strip()


def _by_size(cases: dict[str, Case]) -> str:
    edges = [0.0, 0.015, 0.03, 0.06, 0.12, 1e9]
    single = [case for case in cases.values() if case[0]["kind"] == "one"]
    rows = []
    for low, high in pairwise(edges):
        mine = [case for case in single if low <= case[0]["sizes"][0] < high]
        right = sum(is_right(*case) for case in mine)
        silent = sum(case[1]["verdict"] == "no_effect" for case in mine)
        label = f"{100 * low:g}–{100 * high:g} %" if high < 1e9 else f"from {100 * low:g} %"
        rows.append([label, len(mine), right, silent])
    return table(
        ["share of torque RMS", "cases", "right", "no_effect"], rows, "Size against the chance of finding it"
    )


def _by_effect(cases: dict[str, Case]) -> str:
    counts: dict[str, list[int]] = {}
    confused: dict[str, Counter[str]] = {}
    for hidden, verdict in cases.values():
        if hidden["kind"] != "one" or hidden["sizes"][0] < LARGE:
            continue
        name = hidden["effects"][0]["name"]
        count = counts.setdefault(name, [0, 0])
        count[1] += 1
        if is_right(hidden, verdict):
            count[0] += 1
        else:
            got = " + ".join(e["effect"] for e in verdict["effects"]) or verdict["verdict"]
            confused.setdefault(name, Counter())[got] += 1
    rows = [
        [
            name,
            f"{right} of {total}",
            ", ".join(f"{k} ({c})" for k, c in confused.get(name, Counter()).items()),
        ]
        for name, (right, total) in sorted(counts.items())
    ]
    return table(["effect", "right", "taken for"], rows, f"One effect of at least {LARGE:.0%}")


def _parameters(cases: dict[str, Case]) -> str:
    found: dict[str, list[tuple[float, float]]] = {}
    for hidden, verdict in cases.values():
        if hidden["kind"] in ("one", "two", "carried", "stop", "tendon") and min(hidden["sizes"]) >= LARGE:
            for key, relative, standard in deviations(hidden, verdict):
                found.setdefault(key, []).append((relative, standard))
    rows = []
    for key, values in sorted(found.items()):
        relative, standard = np.array(values).T
        good = np.mean((relative <= TOLERANCE) | (standard <= ERRORS))
        rows.append(
            [key, len(values), f"{np.median(relative):.1%}", f"{np.median(standard):.1f}", f"{good:.0%}"]
        )
    headers = ["parameter", "cases", "median off by", "median in standard errors", "within 10 % or 3 errors"]
    return table(headers, rows, "Parameters of effects that were named rightly")
