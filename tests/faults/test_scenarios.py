"""Scenarios with one thing wrong: one line that names file and field, status 2, nothing written."""

import warnings
from pathlib import Path

import pytest
from faults.conftest import LONG, contents, one_line

from armloop.cli import main
from armloop.util.errors import InputError
from armloop.util.reading import read_yaml

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
    "a gain in minutes and seconds": (
        "plant: three_axis\nkp: [1:30]\n",
        "line 2: 1:30 is no plain number; write it like",
    ),
    "a fraction of them": ("plant: three_axis\nkp: [1:30.5]\n", "line 2: 1:30.5 must be a finite number"),
    "an octal gain": ("plant: three_axis\nkp: [010]\n", "line 2: 010 is no plain number"),
    "a field that is a number": ("plant: three_axis\n3: 4\n", "line 2: a field's name must be text"),
    "a field that is a list": ("? [a, b]\n: 1\n", "line 1: a field's name must be text"),
    "a field that is false": ("plant: three_axis\nno: 4\n", "line 2: a field's name must be text"),
    "a score of a moment": (
        "plant: three_axis\nreference: {kind: fourier, duration: 5.0}\nscore: [1.0, 1.005]\ncontrollers: [pid]\n",
        r"score is \[1.0, 1.005\]; it must be a start and an end in 0 to 5 s, 0.01 s or more apart",
    ),
    "a faulty effect of a short motion": (
        "plant: three_axis\nreference: {kind: fourier, duration: 5.0}\neffects: [{effect: gremlin, joint: 2}]\n",
        "effects: .*gremlin",
    ),
    "an infinite gain": ("plant: three_axis\nkp: [.inf]\n", "finite number"),
    "a gain of 1e999": ("plant: three_axis\nkp: [1e999]\n", "finite number"),
    "a gain of 1e300": ("plant: three_axis\nkp: [1.0e+300]\n", r"kp\[1\] is 1e\+300"),
    "a gain that is a word": ("plant: three_axis\nkp: [high]\n", r"kp\[1\] is 'high'"),
    "a gain that is a date": ("plant: three_axis\nkp: [2020-01-01]\n", r"kp\[1\] is"),
    "gains for 40 joints": (f"plant: three_axis\nkp: [{', '.join(['1.0'] * 40)}]\n", "at most 16"),
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
    "a controller twice": (
        "plant: three_axis\ncontrollers: [pid, pid_step1, pid]\n",
        "controllers: pid stands there twice; name each once",
    ),
    "a load and wear": ("plant: three_axis\npickup: {}\nwear: {}\n", "pickup and wear are two kinds of run"),
    "a load under other controllers": (
        "plant: three_axis\ncontrollers: [pid]\npickup: {}\n",
        "controllers: a pickup is run by pid_step3 alone; leave them out",
    ),
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
