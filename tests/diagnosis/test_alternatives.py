"""Why two effects look alike: a sentence of their own where one is known, and what to do where none is."""

import pytest

from armloop.diagnosis.verdict import why_alike
from armloop.laws.effects import effect


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
            "joint_spring at joint 2 explains held-out data nearly as",
        ),
    ],
)
def test_the_sentence_names_what_would_tell_them_apart(found, rival, says):
    words = why_alike(effect(*found), effect(*rival))
    assert says in words and "\n" not in words
