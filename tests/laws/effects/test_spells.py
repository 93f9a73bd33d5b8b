"""Intervals in which an effect is there: which samples they are, how they are told, and what a file may hold."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rubbing_arm import model_with_baseline
from synthetic import fourier_motion

from armloop.data.motion import Motion
from armloop.laws.effects import Estimate, effect
from armloop.laws.effects.spells import Interval, Spells
from armloop.model import AddedEffect
from armloop.model.model import model_of
from armloop.util.errors import ModelError

MOTION = fourier_motion(4.0, 50.0, 1)


def interval(motion: Motion, first: int, last: int, log: str = "") -> Interval:
    return Interval(float(motion.time[first]), float(motion.time[last]), tuple(motion.q[first].tolist()), log)


SPELLS = Spells((interval(MOTION, 20, 60, "a_run"), interval(MOTION, 100, 140, "a_run")), 0.05)


def added(spells: Spells) -> AddedEffect:
    return AddedEffect(effect("coulomb_friction", 2).within(spells), {"level": Estimate(0.4, 0.01, "N*m")})


def test_it_is_there_within_them_and_in_no_other_log() -> None:
    rows = np.zeros(200, dtype=bool)
    rows[20:61] = rows[100:141] = True
    np.testing.assert_array_equal(SPELLS.there(MOTION), rows)
    other = fourier_motion(4.0, 50.0, 2)
    assert not SPELLS.there(other).any()
    np.testing.assert_array_equal(SPELLS.there(Motion.joined([other, MOTION])), np.r_[rows & False, rows])
    whole = AddedEffect(effect("coulomb_friction", 2), added(SPELLS).parameters)
    model = model_with_baseline()
    more, always = (
        model.with_effects([x]).predict(MOTION) - model.predict(MOTION) for x in (added(SPELLS), whole)
    )
    np.testing.assert_array_equal(more, always * rows[:, None])


def test_it_is_told_with_its_times() -> None:
    assert SPELLS.words() == "from 0.4 to 1.2 s and from 2.0 to 2.8 s of a_run"
    first = replace(SPELLS.intervals[0], log="")
    assert added(Spells((first,), 0.05)).sentence().endswith(", from 0.4 to 1.2 s")
    words, times = zip(*SPELLS.instants, strict=True)
    assert words == ("from", "to") * 2 and times == pytest.approx((0.4, 1.2, 2.0, 2.8))


def test_a_model_file_keeps_it_and_says_what_is_none() -> None:
    model = model_with_baseline().with_effects([added(SPELLS)])
    kept = json.dumps(model.to_dict())
    read = model_of(json.loads(kept), "model.json")
    assert read.effects[0].effect.onset == SPELLS and read.effects[0].effect.event
    faults: list[tuple[dict[str, Any], str]] = [
        ({"posture": [[0.0], [0.0]]}, r"during.posture: 1 joints, the arm has 3"),
        ({"posture": [[0.0] * 3]}, "each end must come after its start, as many of them"),
        ({"end": [1.2]}, "each end must come after its start, as many of them"),
        ({"end": [0.4, 2.8]}, "each end must come after its start, as many of them"),
        ({"log": ["a_run"]}, "each end must come after its start, as many of them"),
        ({"start": [], "end": [], "posture": [], "log": []}, "start"),
    ]
    for changed, words in faults:
        data = json.loads(kept)
        data["effects"][0]["during"] |= changed
        with pytest.raises(ModelError, match=words):
            model_of(data, "model.json")
    data = json.loads(kept)
    del data["effects"][0]["during"]["log"]
    assert [i.log for i in model_of(data, "model.json").effects[0].effect.onset.intervals] == ["", ""]
    since = {"value": 1.0, "std_error": 0.1, "posture": [0.0] * 3}
    data["effects"][0]["since"] = since
    with pytest.raises(ModelError, match=r"effects\[1\]: has since and during"):
        model_of(data, "model.json")
