"""Why two effects look alike: a sentence of their own where one is known, and what to do where none is."""

import pytest

from armloop.diagnosis.verdict import why_alike
from armloop.laws.effects import effect
from armloop.laws.effects.onset import Onset


@pytest.mark.parametrize(
    ("found", "rival", "says"),
    [
        (("torque_offset", 2), ("joint_spring", 2), "a larger range of the joint"),
        (("joint_spring", 2), ("torque_offset", 2), "a larger range of the joint"),
        (("torque_offset", 2), ("friction_asymmetry", 2), "no motion tells them apart"),
        # a joint that rubs harder one way needs a constant torque, and is mistaken for what a constant is mistaken for
        (("friction_asymmetry", 2), ("joint_spring", 2), "a larger range of the joint"),
        (("joint_spring", 2), ("friction_asymmetry", 2), "a larger range of the joint"),
        (("gravity_tilt", None), ("friction_asymmetry", 1), "a tilt is a constant"),
        (("friction_asymmetry", 1), ("gravity_tilt", None), "a tilt is a constant"),
        (("torque_gain", 3), ("torque_offset", 3), "different loads"),
        (("torque_ripple", 1), ("joint_spring", 1), "several periods"),
        # of two joints nothing is known
        (("torque_offset", 2), ("joint_spring", 3), "--next-run designs one"),
        (
            ("quadratic_drag", 2),
            ("joint_spring", 2),
            "joint spring at joint 2 explains held-out data nearly as",
        ),
    ],
)
def test_the_sentence_names_what_would_tell_them_apart(found, rival, says):
    words = why_alike(effect(*found), effect(*rival))
    assert says in words and "\n" not in words


#: An effect of an interval of a run, which is an event of it.
_FOR_A_TIME = effect("torque_offset", 2).within(Onset(12.0, 0.1, until=True, posture=(0.0, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("found", "rival"),
    [
        (effect("external_torque", 2), effect("external_contact", None)),
        (effect("carried_load", None), effect("external_torque", 2)),
        (_FOR_A_TIME, effect("external_contact", None)),
    ],
)
def test_no_further_run_is_said_to_tell_what_an_event_was(found, rival):
    for words in (why_alike(found, rival), why_alike(rival, found)):
        assert "no further run tells them apart" in words and "--next-run" not in words


def test_of_an_event_and_an_effect_that_lasts_a_further_run_shows_the_latter():
    spring = effect("joint_spring", 2)
    for words in (why_alike(_FOR_A_TIME, spring), why_alike(spring, _FOR_A_TIME)):
        assert "a further run tells whether joint spring at joint 2 is still there" in words
        assert "without torque offset at joint 2, which was an event" in words
