"""An unlisted law in a model: one torque whoever is asked, full where it was found and none far outside, and its faults."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from exact_parts import model_of, random_motion
from numpy.testing import assert_allclose
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from synthetic import three_axis

from armloop.drake import EffectTorque
from armloop.dynamics import Dynamics
from armloop.export.c_code import c_source
from armloop.export.reading_c import CompiledTorque, compiler
from armloop.laws.effects import FoundLaw, effect, found_law, hypotheses
from armloop.model import AddedEffect, load_model
from armloop.util.errors import ModelError

ARM = three_axis()
TERMS = {"cos(2*q1-q3)*v2": (0.5, 0.02), "sin(3*q2)*v3^2*sign(v3)": (-0.3, 0.01), "1": (0.1, 0.01)}
MOTION = random_motion(3, 200, 3)
#: The law is found in half of the motion's range.
HALF = [0.5 * np.abs(x).max(axis=0) for x in (MOTION.q, MOTION.v)]
PARAMETERS = found_law(ARM, 2, TERMS, (-HALF[0], -HALF[1]), (HALF[0], HALF[1]))
LAW = AddedEffect(FoundLaw(2), PARAMETERS)
BARE = model_of(ARM)
MODEL = BARE.with_effects([LAW])


def expected() -> np.ndarray:
    """The torque at joint 2, written out."""
    (q1, q2, q3), (_, v2, v3) = MOTION.q.T, MOTION.v.T
    plain = 0.5 * np.cos(2 * q1 - q3) * v2 - 0.3 * np.sin(3 * q2) * v3 * abs(v3) + 0.1
    used = [(q1, HALF[0][0]), (q2, HALF[0][1]), (q3, HALF[0][2]), (v2, HALF[1][1]), (v3, HALF[1][2])]
    for x, half in used:
        s = np.clip((1.2 - abs(x) / half) / 0.2, 0.0, 1.0)
        plain = plain * (3 * s**2 - 2 * s**3)
    return plain


def rows() -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    return list(zip(MOTION.q, MOTION.v, MOTION.vdot, strict=True))


def test_everyone_who_is_asked_gives_one_torque() -> None:
    tau = np.zeros_like(MOTION.q)
    tau[:, 1] = expected()
    inside = (np.abs(MOTION.q) < HALF[0]).all(axis=1) & (np.abs(MOTION.v) < HALF[1])[:, 1:].all(axis=1)
    assert inside.any() and (tau[:, 1] == 0).any() and np.abs(tau[inside, 1]).max() > 0.2
    assert_allclose(MODEL.predict(MOTION) - BARE.predict(MOTION), tau, atol=1e-12)
    assert_allclose([MODEL.feedforward(*x) - BARE.feedforward(*x) for x in rows()], tau, atol=1e-12)
    full, bare = Dynamics(MODEL), Dynamics(BARE)
    bias = [full.bias(q, v) + full.gravity(q) - bare.bias(q, v) - bare.gravity(q) for q, v, _ in rows()]
    assert_allclose(bias, tau, atol=1e-12)


def test_it_fades_beyond_the_ends_of_its_range_wherever_that_lies() -> None:
    """Found from 1 to 5 rad/s: full there, half of it 0.2 rad/s beyond, nothing from 0.4 rad/s on."""
    low, high = np.array([0.0, 1.0, 0.0]), np.array([0.0, 5.0, 0.0])
    added = AddedEffect(FoundLaw(2), found_law(ARM, 2, {"v2": (0.5, 0.0)}, (0 * low, low), (0 * high, high)))
    law = added.pointwise(ARM, None)
    for v, part in (
        *((1.0, 1.0), (3.0, 1.0), (5.0, 1.0), (5.2, 0.5), (5.4, 0.0), (9.0, 0.0)),
        *((0.8, 0.5), (0.6, 0.0), (-3.0, 0.0)),
    ):
        tau = law(np.zeros(3), np.array([0.0, v, 0.0]), np.zeros(3))
        assert_allclose(tau, [0.0, 0.5 * v * part, 0.0], atol=1e-12)


def test_drake_differentiates_it() -> None:
    system = EffectTorque(ARM, "unlisted", 2, LAW.values)
    state = np.concatenate([MOTION.q[7], MOTION.v[7]])

    def torque(x: Any, which: Any) -> Any:
        context = which.CreateDefaultContext()
        which.get_input_port(0).FixValue(context, x)
        return which.get_output_port(0).Eval(context)

    step = 1e-6
    numeric = [
        (torque(state + step * e, system) - torque(state - step * e, system)) / (2 * step) for e in np.eye(6)
    ]
    exact = torque(InitializeAutoDiff(state).ravel(), system.ToAutoDiffXd())
    assert_allclose(ExtractValue(exact).ravel(), torque(state, system))
    assert_allclose(ExtractGradient(exact), np.transpose(numeric), atol=1e-6)


@pytest.mark.skipif(compiler() is None, reason="no C compiler (cc, gcc, clang)")
def test_it_is_exported_to_c(tmp_path: Any) -> None:
    source, formulas = c_source(MODEL)
    assert not formulas.left_out
    (tmp_path / "arm.c").write_text(source)
    torque = CompiledTorque(tmp_path / "arm.c").torque(MOTION.q, MOTION.v, MOTION.vdot)
    assert_allclose(torque, [MODEL.feedforward(*x) for x in rows()], rtol=1e-12, atol=1e-12)


def test_a_model_file_keeps_it(tmp_path: Any) -> None:
    MODEL.save(tmp_path / "model.json")
    again = load_model(tmp_path / "model.json")
    assert again.effects[-1].parameters == PARAMETERS
    assert_allclose(again.predict(MOTION), MODEL.predict(MOTION))
    assert [PARAMETERS[name].unit for name in TERMS] == ["N*m*s/rad", "N*m*s^2/rad^2", "N*m"]
    assert "law that is not listed: (0.5 ± 0.02) cos(2*q1-q3)*v2" in LAW.effect.sentence(PARAMETERS)


def test_no_search_asks_for_it() -> None:
    assert "unlisted" not in {each.name for each in hypotheses(ARM)}
    assert isinstance(effect("unlisted", 1), FoundLaw)


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("__import__('os')", None, "is no wave, position, speed or direction"),
        ("sin(q1*q2)", None, "'q1\\*q2' is no sum of angles"),
        ("sign(q1)", None, "sign\\(\\) takes one speed"),
        ("v0", None, "joints are counted from 1"),
        ("v7", None, "a joint that its range does not know"),
        ("v1", ("q_low", [0.0, 0.0]), "needs q_low, q_high, v_low, v_high"),
        ("v1", ("every", [0.0, 0.0]), "another number of joints than the arm, 3"),
    ],
)
def test_a_file_with_another_law_is_refused_in_one_line(
    tmp_path: Any, name: str, change: Any, says: str
) -> None:
    data = MODEL.to_dict()
    parameters = data["effects"][-1]["parameters"]
    for key in [key for key in parameters if key in TERMS]:
        del parameters[key]
    parameters[name] = {"value": 1.0, "std_error": 0.1, "unit": "N*m"}
    for key in (
        [] if change is None else [change[0]] if change[0] != "every" else [k for k in parameters if "_" in k]
    ):
        parameters[key] = {"value": change[1], "std_error": change[1], "unit": "rad"}
    (tmp_path / "model.json").write_text(json.dumps(data))
    with pytest.raises(ModelError, match=says) as caught:
        load_model(tmp_path / "model.json")
    assert "\n" not in str(caught.value)


def test_a_range_must_know_the_joints_of_all_terms() -> None:
    known = {
        key: [-1.0] * 3 if key.endswith("low") else [1.0] * 3
        for key in ("q_low", "q_high", "v_low", "v_high")
    }
    for term, right in (("cos(q3)*v3", True), ("cos(q4)", False), ("v4", False), ("sin(q1+q4)", False)):
        fault = FoundLaw.fault({term: 1.0, **known})
        assert (fault == "") == right and (right or "a joint that its range does not know" in fault)
