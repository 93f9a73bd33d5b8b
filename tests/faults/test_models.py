"""Model files with one thing wrong: one line that names file and field, status 2; and what old files become."""

import json
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from faults.conftest import one_line
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.identification.reconstruction import Options, reconstruct
from armloop.model import load_model


def at(*keys: str | int) -> Callable[[Any], Callable[[Any], None]]:
    """A field of the file; given a value, the change that puts it there; ``...`` takes the field away."""

    def to(value: Any) -> Callable[[Any], None]:
        def change(data: Any) -> None:
            for key in keys[:-1]:
                data = data[key]
            if value is ...:
                del data[keys[-1]]
            else:
                data[keys[-1]] = value

        return change

    return to


PAYLOAD, OFFSET = ("effects", 0, "parameters"), ("effects", 1, "parameters", "offset")
# field, values that cannot stand there, what the line says of each
ROWS: list[tuple[tuple[str | int, ...], list[Any], str]] = [
    (("schema",), ["armloop/model/3", "armloop/loop/1", 1, None, [], ...], "schema is"),
    (("arm",), [None, [], 3, "three_axis"], r"arm is .*a mapping of fields"),
    (("arm", "name"), [None, 3, "x" * 1000], r"arm\.name"),
    (("arm", "joints", 1, "name"), [None, "", " ", "joint_1"], r"arm\.joints\[2\]\.name"),
    (("arm", "joints"), [None, [], {}, "3", ...], r"joints"),
    (("arm", "joints", 0, "kind"), ["ball", None, 1, ""], r"arm\.joints\[1\]\.kind is .*there are|text"),
    (("arm", "joints", 0, "lower"), ["low", None, 1e300, 5.0, []], r"joints\[1\]\.lower|lower below upper"),
    (("arm", "joints", 1, "upper"), ["high", None, -1e300, -9.0], r"joints\[2\]\.upper|lower below upper"),
    (("arm", "joints", 2, "velocity"), [-1.0, "fast", None, 1e300], r"joints\[3\]\.velocity"),
    (("arm", "joints", 2, "effort"), [-1.0, "strong", None], r"joints\[3\]\.effort"),
    (("arm", "joints", 0, "damping"), [1.0], r"field 'damping' is unknown; there are: name, kind"),
    (("arm", "X_PF", 1, 0, 0), [2.0, -1.0, 1e12, 1e-300], r"arm\.X_PF\[2\] is no pose"),
    (("arm", "X_PF", 2, 3), [[0, 0, 0, 2], [1, 0, 0, 1], [0, 0, 0, 0]], r"arm\.X_PF\[3\] is no pose"),
    (("arm", "X_tool", 1, 2), [0.5, -1e12], r"arm\.X_tool is no pose"),
    (("arm", "inertia", 1, 2, 2), [-1.0, -1e12], r"arm\.inertia\[2\] is no inertia"),
    (("arm", "inertia", 0, 0, 1), [0.5], r"arm\.inertia\[1\] is no inertia: it must be symmetric"),
    (
        ("arm", "joints", 0, "name"),
        ["a\x1b[31m", "a\u202eb", "a\nb"],
        r"arm\.joints\[1\]\.name is .* cannot be shown",
    ),
    (("arm", "X_PF"), [None, [], [1.0, 2.0], [[[0.0]]]], r"X_PF"),
    (("arm", "axis", 0), [[0.0, 0.0, 0.0], [0.0, 0.0], [0, 0, 2], "z", None], r"axis\[1\]"),
    (("arm", "mass", 0), [-1.0, "1kg", None, 1e300, 1e9], r"mass\[1\]"),
    (("arm", "mass"), [[1.0], [], None, [1.0] * 40], "mass"),
    (("arm", "com", 0, 0), ["x", None, 1e300, []], r"com\[1\]\[1\]"),
    (("arm", "com", 1, 2), [1e12, -1e6], r"arm\.com\[2\] lies 1e\+\d+ m away"),
    (("arm", "X_PF", 1, 2, 3), [1e9], r"arm\.X_PF\[2\] lies 1e\+09 m away"),
    (("arm", "X_tool", 0, 3), [-1e9], r"arm\.X_tool lies 1e\+09 m away"),
    (("arm", "inertia", 0, 0), [[1.0], "x", None], r"inertia\[1\]\[1\]"),
    (("arm", "gravity"), [[0.0], 9.81, None, [0, 0, "down"]], "gravity"),
    (("arm", "X_tool"), [[[1.0]], None, "I"], "X_tool"),
    (("components",), [None, {}, "x"], r"components is"),
    (("components", 0, "kind"), ["magic", None, ..., 3], "kind|unknown"),
    (("components", 0, "parameters"), [None, [], [1.0] * 7, ["a"] * 30, [1e300] * 30, ...], "parameters"),
    (
        ("components", 0, "parameters", 20),
        [1e9, -2e6],
        "rigid_body: the mass of link 3 is .*; no link has more than 1e",
    ),
    (
        ("components", 0, "base_parameters"),
        [None, [], {"m1": "x"}, {"m1": None}, {"zzz": 1.0}, ...],
        "base_parameters",
    ),
    (
        ("friction",),
        [None, {}, [[], []], [[]] * 40, [["sign"], [], []], {"sign": 1}, "none", ...],
        "friction",
    ),
    (("friction", 0, 0, "kind"), ["magic", None, 3, ...], "magic|kind"),
    (("friction", 0, 0, "coefficient"), ["big", None, 1e300, [], ...], "coefficient"),
    (("friction", 0, 1, "parameter"), [-1.0, "x", None, 1e300], "parameter"),
    (("effects",), [None, {}, "x", ...], "effects"),
    (("effects", 0, "effect"), ["magic", None, 3, ...], "magic|effect"),
    (("effects", 0, "joint"), [2, 99, "1", 1.5], r"joint"),
    (("effects", 1, "joint"), [None, 0, -1, 4, 10**30, "2", ...], "joint"),
    ((*PAYLOAD, "mass"), [None, 0.4, [], ...], "mass"),
    ((*PAYLOAD, "mass", "value"), [0.0, "x", None, 1e300, [], ...], "mass|payload"),
    ((*PAYLOAD, "mass", "std_error"), [-0.1, "x", {}, 1e300, ...], "std_error"),
    ((*PAYLOAD, "mass", "unit"), [None, 3, ...], "unit"),
    (
        (*PAYLOAD, "mass", "unit"),
        ["g", "x", "lb"],
        r"effect payload: the unit of mass is '.+'; it must be 'kg'",
    ),
    (
        (*OFFSET, "unit"),
        ["mN*m"],
        r"torque_offset at joint 2: the unit of offset is 'mN\*m'; it must be 'N\*m'",
    ),
    ((*PAYLOAD, "com", "value"), [[0.0, "x", 0.0], [99.0, 0.0, 0.0], None, "x"], "com|payload"),
    ((*PAYLOAD, "com", "std_error"), [[0.1, 0.1], "x", [-1.0] * 3], "std_error|com"),
    ((*OFFSET, "std_error"), [[], [0.1]], "std_error|one length"),
    ((*OFFSET, "value"), ["x", None, 1e300, ...], "offset|value"),
    (("conditioning",), [None, [], "x", ...], "conditioning"),
    (("conditioning", "cutoff_hz"), [-1.0, 1e-9, 1e300, "ten", None, ...], "cutoff_hz"),
    (("conditioning", "oversampling"), [0, -1, 1e300, "x"], "oversampling"),
    (("conditioning", "dead_zone"), [-1, "x", 1e300], "dead_zone"),
    (("conditioning", "magic"), [1.0], "field 'magic' is unknown; there are: cutoff_hz"),
    (("recorded",), [None, [], ...], "recorded"),
    (("recorded", "unit"), ["lbf", None, 3, ...], "unit"),
    (("recorded", "drive_gains"), [[1.0, 2.0], [0.0] * 3, [-1.0] * 3, ["a"] * 3, 3], "drive_gains"),
    (("baseline",), [None, [], "x", ...], "baseline"),
    (("baseline", "rmse"), [None, [1.0], [-1.0] * 3, ["a"] * 3, 3, [1e300] * 3], "rmse"),
    (("baseline", "nrmse"), [None], r"baseline\.nrmse is None; it must be a list"),
    (("baseline", "worst"), [None], r"baseline\.worst is None; it must be a list"),
    (("baseline", "null"), [None, "x", [{"effect": "payload", "joint": None, "stretches": 8}]], "null"),
    (
        ("baseline", "null"),
        [[{"effect": "payload", "joint": None, "removed": [1.0], "stretches": 8}]],
        "removed of 'payload'",
    ),
    (("baseline", "joints"), [None, "x", [{}] * 3, [{"joint": 1}], [{"joint": 1, "x": 0}] * 3], "joints"),
    (("history",), [None, [], "x", ...], "history"),
    (("history", "logs"), [3, "run", [3], {}], "logs"),
    (
        ("history", "range"),
        [None, [[1.0]], [1.0] * 4, "wide", [["a"] * 3] * 4, [[-1.0] * 3] * 4, [[1.0] * 2] * 4],
        "range",
    ),
    (("history", "slowest"), [None, [0.1], [0.1] * 4, [-0.1] * 3, ["a"] * 3, 0.1, [1e300] * 3], "slowest"),
    (("history", "velocity_noise"), [None, [0.1], [-0.1] * 3, ["a"] * 3, 0.1, [1e300] * 3], "velocity_noise"),
    (("history", "inertial"), [None, [1.0], "x", [1e300] * 30, 3], "inertial"),
    (("history", "notes"), [3, [3]], "notes"),
    (
        ("history", "encoder_zeros"),
        [
            None,
            3,
            {},
            {"spread": "wide"},
            *({"spread": spread} for spread in ([], [0.1] * 2, [-0.1] * 3, [1e300] * 3)),
            {"spread": [0.1] * 3, "logs": [{"log": "run", "zeros": "x"}]},
        ],
        "encoder_zeros",
    ),
    (("uncertainty",), [None, [], "x"], "uncertainty"),
    (("uncertainty", "between_logs"), [[None] * 4, [None]], "between_logs: . joints, the arm has 3"),
    (
        ("uncertainty", "friction"),
        [[{}], [{"v1": {"std_error": -1.0, "degrees_of_freedom": 3}}] * 3, 3],
        "friction",
    ),
    (
        ("uncertainty", "joints"),
        [[{}] * 2, [{"m1": {"std_error": "x", "degrees_of_freedom": 3}}] * 3],
        "joints",
    ),
]
STEP = {"kind": "terms", "step": 1, "joints": [{"sin(q2)": 1.0}, {}, {}]}
TERMS: dict[str, tuple[dict[str, Any], str]] = {
    "step 99": ({"step": 99}, r"components\[2\]\.step is 99; it must be .*at most 3"),
    "step 0": ({"step": 0}, r"step is 0"),
    "step a word": ({"step": "one"}, r"step is 'one'"),
    "two joints": ({"joints": [{}, {}]}, "terms of step 1: 2 joints, the arm has 3"),
    "another arm's term": ({"joints": [{"sin(q7)": 1.0}, {}, {}]}, r"unknown term 'sin\(q7\)'"),
    "code": ({"joints": [{"__import__('os').system('true')": 1.0}, {}, {}]}, "unknown term"),
    "a word": ({"joints": [{"sin(q2)": "x"}, {}, {}]}, r"sin\(q2\) is 'x'"),
    "null": ({"joints": [{"sin(q2)": None}, {}, {}]}, r"sin\(q2\) is None"),
    "too large": ({"joints": [{"sin(q2)": 1e300}, {}, {}]}, r"sin\(q2\) is 1e\+300"),
    "a long name": ({"joints": [{"s" * 1000: 1.0}, {}, {}]}, "joints"),
}
ENERGY = {
    "term": "cos(q2)",
    "coefficient": 1.0,
    "degrees": [0, 1, 0],
    "sine": False,
    "speeds": [0, 0],
}
ENERGIES: dict[str, tuple[dict[str, Any], str]] = {
    "degrees of two joints": ({"degrees": [0, 1]}, r"degrees of 'cos\(q2\)': 2 joints, the arm has 3"),
    "one speed": ({"speeds": [0]}, r"terms\[1\]\.speeds is \[0\]"),
    "a list of sines": ({"sine": [False]}, r"terms\[1\]\.sine is \[False\]; it must be true or false"),
}
SENSORS: dict[str, tuple[str, int | None, dict[str, float]]] = {
    "a gain of zero": ("torque_gain", 1, {"gain": 0.0}),
    "a delay of 1e9 s": ("time_delay", None, {"seconds": 1e9}),
    "a rotor of negative inertia": ("rotor_inertia", 1, {"inertia": -1.0}),
}


#: Parts of a sum: two of them would count twice.
TWICE: dict[str, tuple[str | int, ...]] = {
    "the rigid body": ("components",),
    "a term of friction": ("friction", 1),
}


def again(*keys: str | int) -> Callable[[Any], None]:
    """Put the first of a list at its end once more."""

    def change(data: Any) -> None:
        for key in keys:
            data = data[key]
        data.append(data[0])

    return change


RANGE = {
    key: [-1.0] * 3 if key.endswith("low") else [1.0] * 3 for key in ("q_low", "q_high", "v_low", "v_high")
}
ADOPTED: dict[str, tuple[dict[str, Any], str]] = {
    "no term": (RANGE, "has no term"),
    "no wave": ({**RANGE, "tan(q1)": 1.0}, "unknown term 'tan\\(q1\\)'"),
    "no power": ({**RANGE, "cos(q1)^0": 1.0}, "a power is at least 1"),
    "joint 0": ({**RANGE, "q0*v1": 1.0}, "joints are counted from 1"),
    "another arm's joint": ({**RANGE, "cos(q1-q9)": 1.0}, "a joint that its range does not know"),
    "that joint without a range": ({"cos(q1-q9)": 1.0}, "a term of joint 9; the arm has 3"),
    "a range turned round": ({**RANGE, "v_low": [2.0] * 3, "v1": 1.0}, "a v_low above its v_high"),
    "half a range": ({"q_low": [0.0] * 3, "v1": 1.0}, "needs q_low, q_high, v_low, v_high"),
    "a range of two joints": ({**RANGE, "q_high": [1.0] * 2, "v1": 1.0}, "needs q_low, q_high"),
}


def cases() -> Iterator[tuple[str, Callable[[Any], None], str]]:
    for keys, values, said in ROWS:
        for value in values:
            name = "gone" if value is ... else repr(value)[:30]
            yield f"{'.'.join(map(str, keys))} {name}", at(*keys)(value), said
    for name, keys in TWICE.items():
        yield f"twice: {name}", again(*keys), "stands twice"
    for name, (change, said) in TERMS.items():
        yield f"terms: {name}", lambda data, c=change: data["components"].append({**STEP, **c}), said
    for name, (change, said) in ENERGIES.items():
        energies = {"kind": "lagrangian", "terms": [ENERGY | change]}
        yield f"energies: {name}", at("components", 0)(energies), said
    for name, (effect, joint, values) in SENSORS.items():
        parameters = {key: {"value": x, "std_error": 0.1, "unit": "1"} for key, x in values.items()}
        added = {"effect": effect, "joint": joint, "parameters": parameters}
        yield name, lambda data, a=added: data["effects"].append(a), f"{effect}.*cannot be"
    for name, (values, said) in ADOPTED.items():
        parameters = {
            key: {"value": x, "std_error": [0.0] * len(x) if isinstance(x, list) else 0.1, "unit": "1"}
            for key, x in values.items()
        }
        added = {"effect": "unlisted", "joint": 2, "parameters": parameters}
        yield f"adopted: {name}", lambda data, a=added: data["effects"].append(a), said


CASES = {name: (change, said) for name, change, said in cases()}


@pytest.mark.parametrize("name", CASES)
def test_a_model_with_one_thing_wrong(
    name: str, right: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, said = CASES[name]
    data = json.loads((right / "model.json").read_text())
    change(data)
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(data))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main(["evaluate", str(path), str(right / "run.csv")]) == 2
    answer = capsys.readouterr()
    assert answer.out == ""
    one_line(answer.err, said)
    assert "bad.json" in answer.err


def test_models_of_the_first_schema_are_read(right: Path, tmp_path: Path) -> None:
    data = json.loads((right / "model.json").read_text())
    del data["uncertainty"]
    data["schema"] = "armloop/model/1"
    (tmp_path / "old.json").write_text(json.dumps(data))
    assert load_model(tmp_path / "old.json").to_dict() == load_model(right / "model.json").to_dict()


def test_what_others_add_is_let_stand(right: Path, tmp_path: Path) -> None:
    data = json.loads((right / "model.json").read_text())
    data["history"]["by_others"] = {"any": ["thing"]}
    data["by_others"] = 1
    (tmp_path / "more.json").write_text(json.dumps(data))
    assert load_model(tmp_path / "more.json").history["by_others"] == {"any": ["thing"]}


def test_an_unknown_standard_error_survives(right: Path, tmp_path: Path) -> None:
    data = json.loads((right / "model.json").read_text())
    data["effects"][1]["parameters"]["offset"]["std_error"] = None
    (tmp_path / "a.json").write_text(json.dumps(data))
    load_model(tmp_path / "a.json").save(tmp_path / "b.json")
    again = json.loads((tmp_path / "b.json").read_text())
    assert again["effects"][1]["parameters"]["offset"]["std_error"] is None


def test_a_model_without_parts_of_its_error_can_be_read_again(tmp_path: Path) -> None:
    """Without them, ``baseline.joints`` is an empty list."""
    motion = fourier_motion(20.0, 100.0, 1)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    options = Options(standard_errors=False, parts=False)
    made = reconstruct([measured(motion, tau, 1)], three_axis(), library="rigid-body", options=options).model
    made.save(tmp_path / "model.json")
    assert made.baseline["joints"] == [] == load_model(tmp_path / "model.json").baseline["joints"]
