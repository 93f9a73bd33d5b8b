"""An effect that begins, or ends, at an instant of one log: when it is there, in which logs, and in a model's file."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from rubbing_arm import model_with_baseline
from synthetic import fourier_motion

from armloop.data.motion import Motion
from armloop.laws.effects import Estimate, effect
from armloop.laws.effects.onset import Onset
from armloop.model import AddedEffect, ReconstructedModel
from armloop.model.model import model_of
from armloop.util.errors import ModelError

VALUE = {"level": Estimate(0.4, 0.01, "N*m")}


def at(motion: Motion, row: int, until: bool, elsewhere: bool = False) -> Onset:
    """The instant of a sample."""
    return Onset(float(motion.time[row]), 0.05, until, tuple(motion.q[row].tolist()), elsewhere, "a_run")


def added(onset: Onset) -> AddedEffect:
    """More dry friction at joint 2 in a part of a log."""
    return AddedEffect(effect("coulomb_friction", 2).within(onset), VALUE)


@pytest.mark.parametrize("until", [False, True])
def test_it_is_there_on_one_side_of_the_instant_and_in_other_logs_as_at_the_end(until: bool) -> None:
    one, other = fourier_motion(4.0, 50.0, 1), fourier_motion(4.0, 50.0, 2)
    onset = at(one, 80, until)
    after = np.arange(200) >= (81 if until else 80)
    np.testing.assert_array_equal(onset.there(one), ~after if until else after)
    # another log passes the same time at another posture
    assert (onset.there(other) == (not until)).all()
    # judged together, clocks that go back do not tell which came first
    for elsewhere in (False, True):
        both = replace(onset, elsewhere=elsewhere).there(Motion.joined([other, one]))
        np.testing.assert_array_equal(both[200:], onset.there(one))
        assert (both[:200] == elsewhere).all()
    # one clock does
    later = replace(other, time=other.time + 10.0)
    earlier = replace(other, time=other.time - 10.0)
    assert (onset.there(Motion.joined([one, later]))[200:] == (not until)).all()
    assert (onset.there(Motion.joined([earlier, one]))[:200] == until).all()


def test_a_controller_supplies_what_is_there_at_the_end() -> None:
    model, motion = model_with_baseline(), fourier_motion(4.0, 50.0, 1)
    q, v, vdot = motion.q[20], motion.v[20], motion.vdot[20]
    whole = model.with_effects([AddedEffect(effect("coulomb_friction", 2), VALUE)])
    since, until = (model.with_effects([added(at(motion, 80 - end, end))]) for end in (False, True))
    np.testing.assert_allclose(since.feedforward(q, v, vdot), whole.feedforward(q, v, vdot))
    np.testing.assert_array_equal(until.feedforward(q, v, vdot), model.feedforward(q, v, vdot))
    # the record has it in its part
    more = [each.predict(motion) - model.predict(motion) for each in (since, until, whole)]
    np.testing.assert_allclose(more[0] + more[1], more[2], atol=1e-12)
    assert not more[0][:80].any() and more[0][80:, 1].any()
    assert not effect("coulomb_friction", 2).event  # the law itself is as it was


@pytest.mark.parametrize("until", [False, True])
def test_a_model_file_keeps_it(until: bool) -> None:
    motion = fourier_motion(4.0, 50.0, 1)
    model = model_with_baseline().with_effects([added(at(motion, 80, until))])
    data = json.loads(json.dumps(model.to_dict()))
    read: ReconstructedModel = model_of(data, "model.json")
    assert read.effects[0].effect.onset == model.effects[0].effect.onset
    assert read.effects[0].effect.event == until
    np.testing.assert_array_equal(read.predict(motion), model.predict(motion))
    data["effects"][0]["until" if until else "since"]["posture"] = [0.0]
    with pytest.raises(ModelError, match="posture: 1 joints, the arm has 3"):
        model_of(data, "model.json")
    data = json.loads(json.dumps(model.to_dict()))
    data["effects"][0] |= {word: model.effects[0].effect.onset.to_model() for word in ("since", "until")}
    with pytest.raises(ModelError, match=r"effects\[1\]: has since and until"):
        model_of(data, "model.json")


def test_its_words_have_the_digits_of_its_error() -> None:
    onset = Onset(31.2345, 0.42, False, (0.0,), log="run_1")
    assert onset.words() == "since 31.2 ± 0.4 s of run_1"
    assert replace(onset, error=0.0234, until=True, log="").words() == "until 31.23 ± 0.02 s"


def test_a_sensors_remedy_goes_for_what_was_recorded_then() -> None:
    onset = Onset(31.2345, 0.42, False, (0.0,), log="run_1")
    offset = {"offset": Estimate(0.03, 0.001, "rad")}
    slipped, whole = (
        AddedEffect(
            effect("encoder_offset", 2) if when is None else effect("encoder_offset", 2).within(when), offset
        )
        for when in (onset, None)
    )
    assert (
        slipped.remedy() == f"{whole.remedy()}. This goes for what was recorded since 31.2 ± 0.4 s of run_1"
    )
    assert added(onset).remedy() == ""  # what acts on the arm itself
