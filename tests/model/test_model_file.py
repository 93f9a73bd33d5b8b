"""A model file gives the model back exactly; whatever is wrong with a file is answered with one line."""

import json
import pickle
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, three_axis

from armloop.data.signals import Conditioning
from armloop.features.rigid_body import BaseParameters
from armloop.laws.effects import Estimate, effect
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import AddedEffect, ReconstructedModel, load_model
from armloop.model.components import RigidBody, SparseTerms
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import ArmError, InputError, InputWarning, ModelError

Data = dict


def a_model() -> ReconstructedModel:
    """With every kind of component, friction and effects, and numbers that need all their digits."""
    arm, rng = three_axis(), np.random.default_rng(0)
    base = BaseParameters.of_arm(arm, rotors=True)
    full = np.concatenate([nominal_parameters(arm), rng.uniform(0, 0.1, 3)])
    index = np.array([[0, 0, 2], [0, 3, 3], [4, 10, 11], [0, 0, 15]])
    terms = SparseTerms(2, index, rng.normal(size=(4, 3)) * [[1, 0, 1], [1, 1, 1], [0, 0, 1], [1, 1, 0]])
    friction = FrictionLaw(
        (
            (
                FrictionTerm("sign", 0.1 + 0.2),
                FrictionTerm("stribeck", -0.1, 0.1),
                FrictionTerm("viscous", 1 / 3),
            ),
            (FrictionTerm("smooth_sign", 0.5, 0.01), FrictionTerm("hysteresis", 0.3, 1e-3)),
            (FrictionTerm("load_hysteresis", 0.02, 1e-3), FrictionTerm("offset", -0.7)),
        )
    )
    effects = (
        AddedEffect(
            effect("payload", None),
            {
                "mass": Estimate(0.4, 0.01, "kg"),
                "com": Estimate([0.1, 0.0, 0.02], [0.01] * 3, "m"),
                "own_inertia": Estimate(1e-3, 1e-4, "kg*m^2"),
            },
        ),
        AddedEffect(effect("torque_offset", 2), {"offset": Estimate(0.25, 0.01, "N*m")}),
    )
    return ReconstructedModel(
        arm,
        (terms, RigidBody(full, tuple(base.names), base.from_full(full))),
        friction,
        Conditioning(cutoff_hz=9.5),
        {"unit": "A", "drive_gains": [10.0, 11.0, 9.5]},
        {"rmse": [0.1, 0.2, None], "rms": [1.0, 2.0, None], "nrmse": [0.1, 0.1, None], "samples": 100},
        effects,
        {"method": "stepwise", "logs": ["run1"], "notes": []},
    )


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "model.json"
    a_model().save(path)
    return path


def test_a_model_survives_a_round_trip_exactly(saved: Path) -> None:
    model, back = a_model(), load_model(saved, three_axis())
    motion = fourier_motion(3.0, 50.0, 1)
    for step in (1, 2, 3):
        np.testing.assert_array_equal(back.predict(motion, step), model.predict(motion, step))
    assert back.to_dict() == model.to_dict()
    assert (back.recorded, back.baseline, back.conditioning) == (
        model.recorded,
        model.baseline,
        model.conditioning,
    )
    assert [(a.effect.name, a.effect.joint, a.parameters) for a in back.effects] == [
        (a.effect.name, a.effect.joint, a.parameters) for a in model.effects
    ]
    assert back.arm.fingerprint() == model.arm.fingerprint()


def test_the_file_can_be_read_by_a_person(saved: Path) -> None:
    data = json.loads(saved.read_text())
    assert data["schema"] == "armloop/model/2"
    assert data["formulas"][0].startswith("tau1 = ") and "sign(v1)" in data["formulas"][0]
    assert "cos(q1)" not in data["formulas"][0] and "sin(q2)" in data["formulas"][0]


def test_sensor_effects_can_be_left_out_and_effects_are_the_third_steps(saved: Path) -> None:
    model = load_model(saved)
    motion = fourier_motion(1.0, 50.0, 2)
    difference = model.predict(motion) - model.predict(motion, sensors=False)
    np.testing.assert_allclose(difference, np.tile([0, 0.25, 0], (motion.samples, 1)), atol=1e-12)
    bare = ReconstructedModel(model.arm, model.components, model.friction)
    for step in (1, 2):
        np.testing.assert_array_equal(model.predict(motion, step), bare.predict(motion, step))


def test_friction_that_feels_load_feels_a_payload_too(saved: Path) -> None:
    model = load_model(saved)
    motion = fourier_motion(1.0, 50.0, 2)
    bare = ReconstructedModel(model.arm, model.components, model.friction)
    payload = model.effects[0].torque(model.context(motion))
    extra = model.predict(motion, sensors=False) - bare.predict(motion) - payload
    assert np.abs(extra[:, 2]).max() > 0.001 and np.abs(extra[:, :2]).max() < 1e-12


def test_effects_are_told_how_fast_the_models_directions_fade_in(saved: Path) -> None:
    model, motion = load_model(saved), fourier_motion(1.0, 50.0, 2)
    first, *others = model.friction.terms
    faded = (FrictionTerm("smooth_sign", 0.3, 0.02), FrictionTerm("smooth_sign", 0.3, 0.003))
    other = replace(model, friction=FrictionLaw((first, faded, *others[1:])))
    assert other.context(motion).fading[1] == other.context(motion, []).fading[1] == 0.003


def test_a_motion_of_another_number_of_joints_is_refused(saved: Path) -> None:
    motion = fourier_motion(1.0, 50.0, 2, load_arm("scara"))
    with pytest.raises(ModelError, match="3 joints, the motion has 4"):
        load_model(saved).predict(motion)


def test_saving_is_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="No space left"):
        a_model().save(tmp_path / "model.json")
    assert list(tmp_path.iterdir()) == []


def at(*keys: str | int) -> Callable[[object], Callable[[Data], None]]:
    """Change of one field of the file, wherever it is; ``...`` removes it."""

    def to(value: object) -> Callable[[Data], None]:
        def change(data: Data) -> None:
            inner = data
            for key in keys[:-1]:
                inner = inner[key]
            if value is ...:
                del inner[keys[-1]]
            else:
                inner[keys[-1]] = value

        return change

    return to


FIELDS = ("arm", "components", "friction", "effects", "conditioning", "recorded", "baseline", "history")
NAN = float("nan")
# the first component holds sparse terms, the second a rigid body
TAMPERED: dict[str, tuple[Callable[[Data], None], str]] = {
    "another schema": (
        at("schema")("armloop/model/3"),
        r"schema is 'armloop/model/3', of a newer armloop; this one reads up to 'armloop/model/2'",
    ),
    "a diagnosis": (
        at("schema")("armloop/diagnosis/2"),
        r"it must be 'armloop/model/2'; the model of a diagnosis lies beside it, in model\.json",
    ),
    "no schema": (at("schema")(...), r"schema is None"),
    **{f"no {name}": (at(name)(...), f"field '{name}' is missing") for name in FIELDS},
    **{
        f"{name} is null": (at(name)(None), rf"{name} is None; it must be a (list|mapping)")
        for name in FIELDS
    },
    "a term of another arm": (
        at("components", 0, "joints", 0)({"sin(q7)*v1": 1.0}),
        r"unknown term 'sin\(q7\)\*v1': 'sin\(q7\)' is no function of 3 joints",
    ),
    "code for a term": (
        at("components", 0, "joints", 0)({"__import__('os').system('true')": 1.0}),
        r"unknown term ",
    ),
    "NaN in a term": (at("components", 0, "joints", 0)({"sin(q2)": NAN}), "not a finite number"),
    "a word for a coefficient": (
        at("components", 0, "joints", 0)({"sin(q2)": "big"}),
        r"sin\(q2\) is 'big'; it must be a finite number",
    ),
    "terms for two joints": (at("components", 0, "joints")([{}, {}]), "2 joints, the arm has 3"),
    "an unknown component": (
        at("components", 0, "kind")("magic"),
        r"components\[1\]\.kind is 'magic'; there are: 'terms', 'rigid_body', 'lagrangian'",
    ),
    "a rigid body of another size": (
        at("components", 1, "parameters")([1.0] * 7),
        "7 parameters, 3 links need",
    ),
    "NaN in a rigid body": (at("components", 1, "parameters")([NAN] * 30), "not a finite number"),
    "an unknown friction term": (at("friction", 0, 0, "kind")("magic"), "unknown friction term 'magic'"),
    "infinite friction": (at("friction", 0, 0, "coefficient")(float("inf")), "not a finite number"),
    "a friction term without its width": (at("friction", 1, 1, "parameter")(0), "positive parameter"),
    "friction of two joints": (at("friction")([[], []]), "friction: 2 joints, the arm has 3"),
    "an unknown effect": (at("effects", 0, "effect")("magic"), "unknown effect 'magic'"),
    "a payload on a joint": (at("effects", 0, "joint")(2), "joint must be null"),
    "an offset on no joint": (at("effects", 1, "joint")(None), "joint must be a number"),
    "an effect on a joint that is not there": (at("effects", 1, "joint")(9), "joint 9|the arm has 3"),
    "a payload without mass": (at("effects", 0, "parameters", "mass")(...), "field 'mass' is missing"),
    "NaN in an effect": (at("effects", 1, "parameters", "offset", "value")(NAN), "not a finite number"),
    "an arm without joints": (at("arm", "joints")(...), "arm: field 'joints' is missing"),
    "an arm with a pose missing": (
        at("arm", "X_PF")([1.0, 2.0]),
        r"arm\.X_PF\[1\] is 1.0; it must be a list",
    ),
    "NaN in the arm": (at("arm", "com", 0, 0)(NAN), "not a finite number"),
    "an unknown kind of joint": (at("arm", "joints", 0, "kind")("ball"), "'ball'"),
    "a word for the corner": (at("conditioning", "cutoff_hz")("ten"), "cutoff_hz"),
    "a corner below zero": (at("conditioning", "cutoff_hz")(-1.0), "cutoff_hz"),
    "NaN for the dead zone": (at("conditioning", "dead_zone")(-1.0), "dead_zone"),
    "an unknown setting": (at("conditioning", "magic")(1.0), "magic"),
    "an unknown unit": (at("recorded", "unit")("lbf"), "recorded|unit"),
    "no unit": (at("recorded", "unit")(...), "unit"),
    "gains of two joints": (at("recorded", "drive_gains")([1.0, 2.0]), "drive_gains"),
    "a word for a gain": (at("recorded", "drive_gains")(["a", "b", "c"]), r"drive_gains\[1\] is 'a'"),
    "a word in the baseline": (at("baseline", "rmse")(["a", 1.0, 1.0]), r"rmse\[1\] is 'a'"),
    "a baseline of two joints": (at("baseline", "rmse")([1.0, 1.0]), "rmse"),
}


@pytest.mark.parametrize("fault", TAMPERED)
def test_a_file_that_was_tampered_with_is_refused(saved: Path, tmp_path: Path, fault: str) -> None:
    change, expected = TAMPERED[fault]
    data = json.loads(saved.read_text())
    change(data)
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(data))
    with pytest.raises((ModelError, ArmError), match=expected) as caught:
        load_model(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", r"not JSON \(line 1"),
        (b"tau1 = 3*q1\n", r"not JSON \(line 1"),
        (b'{"schema": "armloop/model/2",\n', r"not JSON \(line 2"),
        (b"[1, 2]", r"schema is None"),
        (b"\xff\xfe\x00", r"cannot be read"),
    ],
)
def test_what_is_no_model_file_is_refused(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "bad.json"
    path.write_bytes(content)
    with pytest.raises(ModelError, match=expected) as caught:
        load_model(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    for path, expected in ((tmp_path / "none.json", "no such file"), (tmp_path, "cannot be read")):
        with pytest.raises(ModelError, match=expected):
            load_model(path)


def test_a_model_of_another_arm_is_refused(saved: Path) -> None:
    with pytest.raises(ArmError, match=r"made for three_axis with 3 joints, not for scara with 4"):
        load_model(saved, load_arm("scara"))
    longer = json.loads(json.dumps(three_axis().to_dict()))
    longer["X_PF"][2][0][3] += 0.01
    with pytest.raises(
        ArmError, match=r"made for three_axis \(\w{16}\), but three_axis has other kinematics"
    ):
        load_model(saved, type(three_axis()).from_dict(longer))


def test_a_model_of_an_arm_that_moves_alike_but_weighs_otherwise_is_warned_of(saved: Path) -> None:
    arm = three_axis()
    heavy = replace(arm, name="renamed", mass=arm.mass * [1.0, 1.5, 1.0])
    with pytest.warns(InputWarning, match=r"made with, [\d.]+ kg in that of renamed") as told:
        load_model(saved, heavy)
    assert len(told) == 1 and f"joint {arm.joints[1].name} weighs {arm.mass[1]:.4g} kg" in str(
        told[0].message
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_model(saved, replace(arm, name="renamed", mass=arm.mass * (1 + 1e-9)))


class Bomb:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return exec, ("raise SystemExit('unpickled')",)


def test_nothing_is_ever_unpickled(tmp_path: Path) -> None:
    for protocol in (0, 5):
        path = tmp_path / f"bomb{protocol}.json"
        path.write_bytes(pickle.dumps(Bomb(), protocol))
        with pytest.raises(ModelError, match=r"not JSON|cannot be read"):
            load_model(path)
