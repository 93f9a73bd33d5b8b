"""Model files and scenarios with one thing wrong: one line that names file and field, status 2, nothing written."""

import json
import os
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from faults.conftest import contents
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armloop.cli import main
from armloop.errors import InputError, ModelError
from armloop.files import strict
from armloop.model import load_model
from armloop.reading import read_json, read_yaml

DEEP, LONG = "[" * 100_000, "9" * 400


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
    (("arm", "joints"), [None, [], {}, "3", ...], r"joints"),
    (("arm", "joints", 0, "kind"), ["ball", None, 1, ""], r"arm\.joints\[1\]\.kind is .*there are|text"),
    (("arm", "joints", 0, "lower"), ["low", None, 1e300, 5.0, []], r"joints\[1\]\.lower|lower below upper"),
    (("arm", "joints", 1, "upper"), ["high", None, -1e300, -9.0], r"joints\[2\]\.upper|lower below upper"),
    (("arm", "joints", 2, "velocity"), [-1.0, "fast", None, 1e300], r"joints\[3\]\.velocity"),
    (("arm", "joints", 2, "effort"), [-1.0, "strong", None], r"joints\[3\]\.effort"),
    (("arm", "X_PF"), [None, [], [1.0, 2.0], [[[0.0]]]], r"X_PF"),
    (("arm", "axis", 0), [[0.0, 0.0, 0.0], [0.0, 0.0], [0, 0, 2], "z", None], r"axis\[1\]"),
    (("arm", "mass", 0), [-1.0, "1kg", None, 1e300], r"mass\[1\]"),
    (("arm", "mass"), [[1.0], [], None, [1.0] * 40], "mass"),
    (("arm", "com", 0, 0), ["x", None, 1e300, []], r"com\[1\]\[1\]"),
    (("arm", "inertia", 0, 0), [[1.0], "x", None], r"inertia\[1\]\[1\]"),
    (("arm", "gravity"), [[0.0], 9.81, None, [0, 0, "down"]], "gravity"),
    (("arm", "X_tool"), [[[1.0]], None, "I"], "X_tool"),
    (("components",), [None, {}, "x"], r"components is"),
    (("components", 0, "kind"), ["magic", None, ..., 3], "kind|unknown"),
    (("components", 0, "parameters"), [None, [], [1.0] * 7, ["a"] * 30, [1e300] * 30, ...], "parameters"),
    (("components", 0, "base_parameters"), [None, [], {"m1": "x"}, {"m1": None}, ...], "base_parameters"),
    (("friction",), [None, {}, [[], []], [[]] * 40, "none", ...], "friction"),
    (("friction", 0, 0, "kind"), ["magic", None, 3, ...], "magic|kind"),
    (("friction", 0, 0, "coefficient"), ["big", None, 1e300, [], ...], "coefficient"),
    (("friction", 0, 1, "parameter"), [-1.0, "x", None, 1e300], "parameter"),
    (("effects",), [None, {}, "x", ...], "effects"),
    (("effects", 0, "effect"), ["magic", None, 3, ...], "magic|effect"),
    (("effects", 0, "joint"), [2, 99, "1", 1.5], r"joint"),
    (("effects", 1, "joint"), [None, 0, -1, 4, 10**30, "2", ...], "joint"),
    ((*PAYLOAD, "mass"), [None, 0.4, [], ...], "mass"),
    ((*PAYLOAD, "mass", "value"), [-0.4, 0.0, "x", None, 1e300, [], ...], "mass|payload"),
    ((*PAYLOAD, "mass", "std_error"), [-0.1, "x", {}, 1e300, ...], "std_error"),
    ((*PAYLOAD, "mass", "unit"), [None, 3, ...], "unit"),
    ((*PAYLOAD, "com", "value"), [[0.0, "x", 0.0], [99.0, 0.0, 0.0], None, "x"], "com|payload"),
    ((*PAYLOAD, "com", "std_error"), [[0.1, 0.1], "x", [-1.0] * 3], "std_error|com"),
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
    (("baseline", "rmse"), [[1.0], [-1.0] * 3, ["a"] * 3, 3, [1e300] * 3], "rmse"),
    (("history",), [None, [], "x", ...], "history"),
    (("history", "logs"), [3, "run", [3], {}], "logs"),
    (
        ("history", "range"),
        [[[1.0]], [1.0] * 4, "wide", [["a"] * 3] * 4, [[-1.0] * 3] * 4, [[1.0] * 2] * 4],
        "range",
    ),
    (("history", "inertial"), [[1.0], "x", [1e300] * 30, 3], "inertial"),
    (("history", "notes"), [3, [3]], "notes"),
    (("uncertainty",), [None, [], "x"], "uncertainty"),
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
SENSORS: dict[str, tuple[str, int | None, dict[str, float]]] = {
    "a gain of zero": ("torque_gain", 1, {"gain": 0.0}),
    "a delay of 1e9 s": ("time_delay", None, {"seconds": 1e9}),
    "a rotor of negative inertia": ("rotor_inertia", 1, {"inertia": -1.0}),
}


def cases() -> Iterator[tuple[str, Callable[[Any], None], str]]:
    for keys, values, said in ROWS:
        for value in values:
            name = "gone" if value is ... else repr(value)[:30]
            yield f"{'.'.join(map(str, keys))} {name}", at(*keys)(value), said
    for name, (change, said) in TERMS.items():
        yield f"terms: {name}", lambda data, c=change: data["components"].append({**STEP, **c}), said
    for name, (effect, joint, values) in SENSORS.items():
        parameters = {key: {"value": x, "std_error": 0.1, "unit": "1"} for key, x in values.items()}
        added = {"effect": effect, "joint": joint, "parameters": parameters}
        yield name, lambda data, a=added: data["effects"].append(a), f"{effect}.*cannot be"


CASES = {name: (change, said) for name, change, said in cases()}


def one_line(answer: str, said: str) -> None:
    assert answer.startswith("armloop: ") and answer.endswith("\n") and answer.count("\n") == 1, answer
    assert re.search(said, answer), answer
    assert len(answer) < 1000


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


RAW: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", r"not JSON \(line 1"),
    "a formula": (b"tau1 = 3*q1\n", r"not JSON \(line 1"),
    "half": (b'{"schema": "armloop/model/2",\n', r"not JSON \(line 2"),
    "a list": (b"[1, 2]", "schema is None"),
    "a number": (b"3", "schema is None"),
    "null": (b"null", "schema is None"),
    "no text": (b"\xff\xfe\x00", "is no UTF-8"),
    "zeros": (bytes(100), "not JSON"),
    "lists within lists": (DEEP.encode(), "too deep"),
    "objects within objects": (b'{"a":' * 50_000, "too deep"),
    "an integer of 400 digits": (f'{{"schema": {LONG}}}'.encode(), "a number of 400 digits"),
    "a fraction of 400 digits": (f'{{"schema": 0.{LONG}}}'.encode(), "not a finite number"),
    "a large exponent": (b'{"schema": 1e999}', "not a finite number"),
    "NaN": (b'{"schema": NaN}', "NaN is not a finite number"),
    "infinity": (b'{"schema": -Infinity}', "-Infinity is not a finite number"),
    "a key twice": (b'{"schema": 1, "schema": 2}', "field 'schema' stands twice"),
    "a key twice within": (b'{"schema": {"a": 1, "b": 2, "a": 3}}', "field 'a' stands twice"),
    "two values": (b"{} {}", "not JSON"),
    "a pickle": (b"\x80\x04N.", "no UTF-8|not JSON"),
}


@pytest.mark.parametrize("name", RAW)
def test_what_is_no_model(name: str, right: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, said = RAW[name]
    (tmp_path / "bad.json").write_bytes(content)
    assert main(["evaluate", str(tmp_path / "bad.json"), str(right / "run.csv")]) == 2
    one_line(capsys.readouterr().err, rf"bad\.json: .*({said})|bad\.json: {said}")


def fifo(path: Path) -> None:
    os.mkfifo(path)


def folder(path: Path) -> None:
    path.mkdir()


def large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 33)


def circle(path: Path) -> None:
    path.symlink_to(path)


PLACES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a pipe": (fifo, "is a device or a pipe"),
    "a folder": (folder, "is a folder"),
    "eight gigabytes": (large, "has 8589934592 bytes"),
    "a link to itself": (circle, "cannot be read"),
    "nothing": (lambda path: None, "no such file"),
    "a link to the null device": (lambda path: path.symlink_to("/dev/null"), "is a device"),
    "a link to endless zeros": (lambda path: path.symlink_to("/dev/zero"), "is a device"),
}
READERS = {"a model": ("evaluate", "run.csv"), "a scenario": ("track", "")}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", PLACES)
def test_what_is_no_file(
    name: str, reader: str, right: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, said = PLACES[name]
    command, log = READERS[reader]
    make(tmp_path / "bad.json")
    words = [command, str(tmp_path / "bad.json"), *([str(right / log)] if log else [])]
    assert main(words) == 2
    one_line(capsys.readouterr().err, f"{said}|no such scenario")


@pytest.mark.parametrize(
    "name", ["m" * 300 + ".json", "model\x00.json", "m/" * 3000 + "m", "model\udcff.json"], ids=range(4)
)
def test_names_that_no_file_can_have(name: str, right: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["evaluate", name, str(right / "run.csv")], ["track", name], ["tune", name]):
        assert main(words) == 2
        answer = capsys.readouterr().err
        assert answer.startswith("armloop: ") and answer.count("\n") == 1, answer


# --- scenarios

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
OWN = "own_plant:\n  arm: three_axis\n  friction: [{a}, {a}, {a}]\n"
SCENARIOS: dict[str, tuple[str, str]] = {
    "an alias bomb": (BOMB, "stands for more than"),
    "an alias of itself": ("plant: &a [*a]\n", "an alias of what it is in"),
    "lists within lists": (f"plant: {'[' * 500}{']' * 500}\n", "lists within lists|too deep"),
    "a key twice": ("plant: three_axis\nplant: scara\n", "field 'plant' stands twice"),
    "an object of Python": ("plant: !!python/object/apply:os.system ['true']\n", "unreadable YAML"),
    "an unknown tag": ("plant: !arm three_axis\n", "unreadable YAML"),
    "a tab": ("plant:\tthree_axis\n\tx: 1", "unreadable YAML"),
    "no text": ("\x00", "unreadable YAML"),
    "nothing": ("", "must be a mapping"),
    "a list": ("[1, 2]\n", "must be a mapping"),
    "a word": ("three_axis\n", "must be a mapping"),
    "two documents": ("plant: scara\n---\nplant: scara\n", "unreadable YAML"),
    "gains of 400 digits": (f"plant: three_axis\nkp: [{LONG}]\n", "a number of 400 digits"),
    "gains of 400 digits behind a point": (f"plant: three_axis\nkp: [{LONG}.0]\n", "finite number"),
    "an infinite gain": ("plant: three_axis\nkp: [.inf]\n", "finite number"),
    "a gain of 1e999": ("plant: three_axis\nkp: [1e999]\n", "finite number"),
    "a gain of 1e300": ("plant: three_axis\nkp: [1.0e+300]\n", r"kp\[1\] is 1e\+300"),
    "a gain that is a word": ("plant: three_axis\nkp: [high]\n", r"kp\[1\] is 'high'"),
    "a gain that is a date": ("plant: three_axis\nkp: [2020-01-01]\n", r"kp\[1\] is"),
    "gains for 40 joints": (f"plant: three_axis\nkp: [{', '.join(['1.0'] * 40)}]\n", "at most 24"),
    "a negative gain": ("plant: three_axis\nkd: [-1]\n", "must not be negative"),
    "a negative seed": (
        "plant: three_axis\nrandom_seed: -1\n",
        r"random_seed is -1; it must be .*at least 0",
    ),
    "half a seed": ("plant: three_axis\nrandom_seed: 0.5\n", "random_seed is 0.5; it must be a whole number"),
    "a huge seed": ("plant: three_axis\nrandom_seed: 123456789012345678901234567890\n", "random_seed"),
    "no Stribeck speed": (OWN.replace("{a}", "{stribeck_velocity: 1e-300}"), "stribeck_velocity is 1e-300"),
    "a Stribeck speed of zero": (OWN.replace("{a}", "{stribeck_velocity: 0}"), "stribeck_velocity is 0"),
    "negative friction": (OWN.replace("{a}", "{viscous: -1}"), "viscous is -1"),
    "huge friction": (OWN.replace("{a}", "{viscous: 1e300}"), "viscous is"),
    "no step": (OWN.replace("{a}", "{}") + "  time_step: 0\n", "time_step is 0"),
    "a long step": (OWN.replace("{a}", "{}") + "  time_step: 1\n", "time_step is 1"),
    "a tiny step": (OWN.replace("{a}", "{}") + "  time_step: 1e-12\n", "time_step is 1e-12"),
    "negative counts": (OWN.replace("{a}", "{}") + "  encoder_counts: -1\n", "encoder_counts is -1"),
    "counts without end": (OWN.replace("{a}", "{}") + f"  encoder_counts: {10**18}\n", "encoder_counts is"),
    "no lead": (OWN.replace("{a}", "{}") + "  prismatic_lead: 0\n", "prismatic_lead is 0"),
    "negative noise": (OWN.replace("{a}", "{}") + "  torque_noise: -1\n", "torque_noise is -1"),
    "a reference without end": (
        "plant: three_axis\nreference: {kind: fourier, duration: 1e9}\n",
        "duration is",
    ),
    "a reference of no time": (
        "plant: three_axis\nreference: {kind: fourier, duration: 0}\n",
        "duration is 0",
    ),
    "a million periods": ("plant: three_axis\nreference: {periods: 1000000}\n", "periods is 1000000"),
    "an unknown reference": ("plant: three_axis\nreference: {kind: circle}\n", "reference.kind is 'circle'"),
    "a million draws": ("plant: three_axis\nwear: {samples: 1000000}\n", "samples is 1000000"),
    "one draw": ("plant: three_axis\nwear: {samples: 1}\n", "samples is 1"),
    "a wide spread": ("plant: three_axis\nwear: {spread: 9}\n", "spread is 9"),
    "a load of nothing": ("plant: three_axis\npickup: {mass: 0}\n", "mass is 0"),
    "a load of 1e300 kg": ("plant: three_axis\npickup: {mass: 1e300}\n", "mass is"),
    "a centre of two numbers": ("plant: three_axis\npickup: {com: [0, 0]}\n", "com is"),
    "limits of nothing": ("plant: three_axis\nlimits: {}\n", "limits needs an effort or a rate"),
    "an effort of zero": ("plant: three_axis\nlimits: {effort: [0]}\n", r"effort\[1\] is 0"),
    "all of ten times": ("plant: three_axis\nlimits: {effort: [9], used: 10}\n", "used is 10"),
    "no bandwidth": ("plant: three_axis\nbandwidth: 0\n", "bandwidth is 0"),
    "controllers that are a word": ("plant: three_axis\ncontrollers: pid\n", "controllers is 'pid'"),
    "no controllers": ("plant: three_axis\ncontrollers: []\n", "controllers: empty"),
    "an unknown field": ("plant: three_axis\nKp: [80]\n", "field 'Kp' is unknown; there are: plant"),
    "an unknown field within": (
        "plant: three_axis\nreference: {kin: paper}\n",
        "field 'kin' is unknown; there are: kind",
    ),
    "no plant": ("kp: [80]\n", "plant: give either"),
    "an unknown plant": ("plant: puma\n", "plant: 'puma' is unknown"),
    "a plant that is a path": ("plant: ../../etc/passwd\n", "is unknown"),
    "a plant that is a number": ("plant: 3\n", "plant is 3; it must be text"),
    "a score backwards": ("plant: three_axis\nscore: [4, 2]\n", "score is"),
    "a score of text": ("plant: three_axis\nscore: [now, then]\n", r"score\[1\] is 'now'"),
    "a table that is not there": ("plant: three_axis\nreference: {kind: csv, file: no.csv}\n", "no.csv"),
    "a table that is a device": (
        "plant: three_axis\nreference: {kind: csv, file: /dev/zero}\n",
        "reference.file",
    ),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_scenario_with_one_thing_wrong(name: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, said = SCENARIOS[name]
    (place / "bad.yaml").write_text(text)
    before = contents(place)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main(["track", "bad.yaml", "--out", "out"]) == 2
    answer = capsys.readouterr()
    assert answer.out == ""
    one_line(answer.err, said)
    assert "bad.yaml" in answer.err
    assert contents(place) == before and not (place / "out").exists()


def test_aliases_that_stand_for_little_are_read(tmp_path: Path) -> None:
    (tmp_path / "good.yaml").write_text("a: &a {x: 1e-3}\nb:\n  <<: *a\n  y: 2\n")
    assert read_yaml(tmp_path / "good.yaml", InputError, "it") == {"a": {"x": 1e-3}, "b": {"x": 1e-3, "y": 2}}


# --- migrations


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


# --- properties

JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=8,
)
QUICK = settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def leaves(data: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    yield path
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield from leaves(value, (*path, key))


@QUICK
@given(data=st.data())
def test_any_change_of_a_model_is_read_or_refused_in_one_line(
    right: Path, tmp_path: Path, data: st.DataObject
) -> None:
    model = json.loads((right / "model.json").read_text())
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(list(leaves(model))[1:]))
        inner = model
        for key in path[:-1]:
            inner = inner[key]
        if data.draw(st.booleans()):
            inner[path[-1]] = data.draw(JSON)
        elif isinstance(inner, dict):
            del inner[path[-1]]
        else:
            inner.pop(path[-1])
        if not isinstance(model, dict) or len(list(leaves(model))) < 2:
            break
    file = tmp_path / "any.json"
    file.write_text(json.dumps(model))
    try:
        found = load_model(file)
    except InputError as error:
        assert str(error).startswith(f"{file}: ") and "\n" not in str(error)
    else:  # what is read can be written and read again
        found.save(tmp_path / "again.json")
        assert load_model(tmp_path / "again.json").to_dict() == found.to_dict()


@QUICK
@given(
    content=st.binary(max_size=60)
    | st.text(max_size=60).map(str.encode)
    | JSON.map(lambda x: json.dumps(x).encode())
)
def test_any_bytes_are_no_model(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "any.json").write_bytes(content)
    with pytest.raises(ModelError):
        load_model(tmp_path / "any.json")


@QUICK
@given(content=st.text(max_size=60) | JSON.map(json.dumps))
def test_any_text_is_yaml_or_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "any.yaml").write_text(content, encoding="utf-8", errors="replace")
    try:
        read_yaml(tmp_path / "any.yaml", InputError, "it")
    except InputError as error:
        assert "\n" not in str(error) and "any.yaml" in str(error)


@QUICK
@given(value=JSON)
def test_what_is_written_is_read_as_it_was(tmp_path: Path, value: Any) -> None:
    (tmp_path / "any.json").write_text(strict(value))
    assert read_json(tmp_path / "any.json", InputError, "it") == value
