"""A map written from what a source says of itself, with a question where it says nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from armloop.convert.assemble import rate_ratio
from armloop.convert.headers import suggest
from armloop.convert.inferred import alternatives, clock_of, described, inferred
from armloop.convert.mapping import SCHEMA, UNSAID, Mapping, QuantityMap
from armloop.convert.recording import Recording, some
from armloop.convert.units import FACTORS, RATES, canonical, fitting, time_unit
from armloop.robot.arm import Arm

_BARE = re.compile(r"[A-Za-z_][\w./ +-]*")
#: Whole numbers that go so far are likely counts of an encoder.
_COUNTS = 50
_YAML_WORDS = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}


def suggested(recording: Recording, arm: Arm | None) -> tuple[Mapping, dict[str, str]]:
    """The map of a source, and by field what is not sure of it; what cannot be told has the one column ``?``."""
    mapping, unsure = recording.mapping, dict(recording.unsure)
    if mapping is None or (arm is not None and mapping.n != arm.n and not recording.named):
        names = [] if arm is None else arm.joint_names
        found = suggest(list(recording.columns), names, recording.units)
        if found.mapping is not None and (arm is None or found.mapping.n == arm.n):
            mapping, unsure = found.mapping, found.unsure
        else:
            mapping, unsure = inferred(recording, names)
    if mapping.time.column is None and mapping.time.rate is None:
        time, doubt = clock_of(recording)
        mapping = replace(mapping, time=time)
        unsure |= {"time": doubt} if doubt else {}
    if None in mapping.tau.units():
        unsure["tau.unit"] = "N*m for torques, A for motor currents (then with gains, in N·m/A)"
    for kind, quantity in (("q", mapping.q), ("v", mapping.v)):
        if quantity is not None and None in quantity.units() and UNSAID not in quantity.names():
            unsure[f"{kind}.unit"] = (
                _of_positions(recording, quantity) if kind == "q" else _rates_that_fit(recording, mapping)
            )
    if mapping.time.column is not None and mapping.time.unit is None:
        unsure["time.unit"] = _time_evidence(recording, mapping)
    known = UNSAID not in mapping.q.names()
    if mapping.v is not None and known and not {"q.unit", "v.unit", "time.unit", "v"} & {*unsure}:
        mapping, asked = _asked_anew(recording, mapping, mapping.v)
        unsure |= asked
    return mapping, unsure


def _of_positions(recording: Recording, quantity: QuantityMap) -> str:
    """The question of a position's unit: of whole numbers that go far, whether they are counts."""
    cells = [np.asarray(recording.columns[name], dtype=float) for name in quantity.names()]
    if all((x == np.round(x)).all() for x in cells) and max(np.ptp(x) for x in cells) > _COUNTS:
        counts = "whole numbers: counts? Then unit: rev, scale: 1 over the counts of a turn, offset: minus that at zero"
        return f"{_range(recording, quantity)}, {counts}; or deg?"
    return f"{_range(recording, quantity)}: rad or deg?"


def _asked_anew(recording: Recording, mapping: Mapping, v: QuantityMap) -> tuple[Mapping, dict[str, str]]:
    """The map without units in which v is not the rate of q, whatever the source says, and what to ask about them."""
    clock, unit = mapping.time.column, canonical(mapping.time.unit or "", "time")
    if clock is None or unit is None:
        return mapping, {}
    bare = rate_ratio(recording.columns[clock], recording, mapping.q, v)
    ratio = bare / FACTORS["time"][unit]
    if ratio == 0 or 0.7 < ratio < 1.4:
        return mapping, {}
    if right := time_unit(bare):
        asked = replace(mapping, time=replace(mapping.time, unit=None))
        return asked, {"time": f"v agrees with the rate of q if the unit is {right}, not {unit}"}
    asked = replace(mapping, q=replace(mapping.q, unit=None), v=replace(v, unit=None))
    return asked, {
        "q.unit": f"in the units that are stated q changes {ratio:.3g} times as fast as v says: rad or deg?",
        "v.unit": _rates_that_fit(recording, asked),
    }


def written(mapping: Mapping, unsure: dict[str, str], recording: Recording) -> str:
    """The map as YAML with its doubts as comments; what is not said is a ``?``."""
    lines = [
        f"# A map of {recording.path.name} ({recording.kind}, {recording.samples} rows) to a motion log.",
        "# Answer each ? and look at each line marked unsure, then: armloop convert SOURCE --map THIS --out LOG.parquet",
        f"schema: {SCHEMA}",
    ]
    time = mapping.time
    if any(UNSAID in quantity.names() for quantity in mapping.quantities().values()):
        lines += ["# What the columns show:", *(f"#   {line}" for line in described(recording, time.column))]
    if time.rate is not None:
        lines.append(f"time: {{rate: {time.rate:g}}}")
    elif time.column is None:
        lines.append(f"time: {{rate: {UNSAID!r}}}" + _doubt(unsure, "time"))
    else:
        unit = time.unit or UNSAID
        lines.append(f"time: {{column: {_word(time.column)}, unit: {_word(unit)}}}" + _doubt(unsure, "time"))
    if mapping.joints is not None:
        lines.append(f"joints: {_words(mapping.joints)}" + _doubt(unsure, "joints"))
    elif "joints" in unsure:
        lines.append(f"# joints: unsure: {unsure['joints']}; names here would be matched with the arm's")
    for kind, quantity in mapping.quantities().items():
        lines.append(f"{kind}:{_doubt(unsure, kind)}")
        lines.append(f"  columns: {_words(quantity.names())}")
        if UNSAID in quantity.names():
            lines += [f"  # columns: {_words(names)}" for names in alternatives(recording, mapping)]
        unit = _words(quantity.unit) if isinstance(quantity.unit, list) else _word(quantity.unit or UNSAID)
        lines.append(f"  unit: {unit}" + _doubt(unsure, f"{kind}.unit"))
        if kind == "tau" and None in quantity.units():
            lines.append("  # gains: [..]  N·m per A, one per joint, if these are currents")
    if "v" in unsure and mapping.v is None:
        lines.append(f"# v: unsure: {unsure['v']}")
    extra = [name for name in recording.columns if name not in mapping.used()]
    lines.append(f"keep: all  # {some(extra)}" if extra else "keep: all")
    return "\n".join(lines) + "\n"


def doubts(unsure: dict[str, str]) -> list[str]:
    """What is not sure, one line each."""
    return [f"{field}: {text}" for field, text in unsure.items()]


def _rates_that_fit(recording: Recording, mapping: Mapping) -> str:
    """Which units of q and v go together, where a clock tells."""
    assert mapping.v is not None
    clock, said = mapping.time.column, mapping.q.unit
    if isinstance(said, list):
        return "as that of q, per s"
    if clock is not None and mapping.time.unit is not None and UNSAID not in mapping.q.names():
        plain = QuantityMap(mapping.q.columns, "rad"), QuantityMap(mapping.v.columns, "rad/s")
        ratio = rate_ratio(recording.columns[clock], recording, *plain) / FACTORS["time"][mapping.time.unit]
        pairs = [(q, v) for q, v in fitting(ratio) if said in (None, q)]
        # Angles are the rule; others are named where no angle fits.
        pairs = [pair for pair in pairs if pair[0] in ("rad", "deg")] or pairs
        if pairs:
            return "by the motion, " + ", ".join(v if said else f"{v} if q is in {q}" for q, v in pairs)
    return "as that of q, per s"


def _time_evidence(recording: Recording, mapping: Mapping) -> str:
    assert mapping.time.column is not None
    time = recording.columns[mapping.time.column]
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    text = f"samples are {step:.6g} apart"
    unknown = mapping.q.unit is None and UNSAID not in mapping.q.names()
    if mapping.v is not None and mapping.v.unit is None and unknown:
        # With the rates of the positions' unit, whichever it is.
        plain = QuantityMap(mapping.q.columns, "rad"), QuantityMap(mapping.v.columns, RATES["rad"])
        if unit := time_unit(rate_ratio(time, recording, *plain)):
            return f"{text}; v agrees with the rate of q if it is {unit}"
    return f"{text}: s, ms, us or ns?"


def _range(recording: Recording, quantity: QuantityMap) -> str:
    asked = [name for name, unit in zip(quantity.names(), quantity.units(), strict=True) if unit is None]
    cells = np.concatenate([recording.columns[name] for name in asked])
    return f"from {np.nanmin(cells):.4g} to {np.nanmax(cells):.4g}"


def _doubt(unsure: dict[str, str], field: str) -> str:
    return f"  # unsure: {unsure[field]}" if field in unsure else ""


def _words(names: Sequence[str]) -> str:
    return "[" + ", ".join(_word(name) for name in names) + "]"


def _word(text: str) -> str:
    """A YAML scalar, between quotes unless it is plainly a word."""
    if _BARE.fullmatch(text) and text.lower() not in _YAML_WORDS and canonical(text, "q") is None:
        return text.strip() if text == text.strip() else f"'{text}'"
    return "'" + text.replace("'", "''") + "'"
