"""What a notebook hands in by mistake: another type, another shape, arguments in another order; one line says which."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from faults.conftest import contents

import armloop as al
from armloop.data.motion import Motion
from armloop.drake.plant.exact import exact_model
from armloop.dynamics import Dynamics
from armloop.util.errors import InputError

Call = Callable[[SimpleNamespace], Any]
CSV = "run.csv"


def with_nan(motion: Motion, name: str, value: float) -> Motion:
    """A motion with a number of joint 2 that is none, at sample 3."""
    x = getattr(motion, name).copy()
    x[3, 1] = value
    return replace(motion, **{name: x})


class Lazy:
    """A data frame that knows its columns and gives none, as polars' LazyFrame."""

    def __init__(self, columns: dict[str, Any]) -> None:
        self.columns = list(columns)

    def __getitem__(self, name: str) -> Any:
        raise TypeError("'LazyFrame' object is not subscriptable (aside from slicing)")


#: What was handed in, and what is said of it.
WRONG: dict[str, tuple[Call, str]] = {
    "a log's path that is None": (
        lambda x: al.read_log(None),
        "the path of a log must be text or a pathlib.Path",
    ),
    "a log's path in bytes": (lambda x: al.read_log(b"run.csv"), "it is of type bytes"),
    "a log in place of its path": (lambda x: al.read_log(x.run), "it is of type MotionLog"),
    "a list in place of a path": (lambda x: al.read_log([CSV]), "it is of type list"),
    "paths that are a number": (lambda x: al.read_logs(3), "a list of them; it is of type int"),
    "no path of a log": (lambda x: al.read_logs([]), "there is none; give one at least"),
    "logs in place of their paths": (lambda x: al.read_logs([x.run]), "it is of type MotionLog"),
    "gains in text": (lambda x: al.read_log(CSV, drive_gains="1,1,1"), "drive_gains is no array of numbers"),
    "an arm that is a list": (
        lambda x: al.reconstruct(x.run, ["three_axis"]),
        "the arm must be an Arm, .* list",
    ),
    "an arm that is a number": (lambda x: al.load_arm(3), "the arm must be text or a pathlib.Path"),
    "joints locked in a list": (
        lambda x: al.load_arm("three_axis", ["joint_3"]),
        "lock must be positions by joint",
    ),
    "a lock in text": (
        lambda x: al.load_arm("three_axis", {"joint_3": "0.1"}),
        "lock joint_3 must be a number",
    ),
    "a tip by its number": (
        lambda x: al.load_arm("three_axis", tip=3),
        "tip must be a word or None; it is 3",
    ),
    "a model's path that is None": (lambda x: al.load_model(None), "the path of a model .* must be text"),
    "a log written where its path stands": (lambda x: al.write_log(x.run, "o.csv"), "of type MotionLog"),
    "no log written": (
        lambda x: al.write_log("o.csv", x.run.q),
        "must be a MotionLog; this is of type ndarray",
    ),
    "a model saved nowhere": (
        lambda x: x.model.save(None),
        "must be text or a pathlib.Path; it is of type NoneType",
    ),
    "an export to nowhere": (lambda x: x.model.export("c", None), "the path of an export must be text"),
    "an export to a list": (lambda x: x.model.export(["c"], "o.c"), "to must be a word"),
    "a report to nowhere": (lambda x: x.model.score(x.run).report(3), "must be text or a pathlib.Path"),
    "no log at all": (lambda x: al.reconstruct([], "three_axis"), "there is no log; give one at least"),
    "a corner in text": (
        lambda x: al.reconstruct(x.run, "three_axis", cutoff="5"),
        "cutoff must be a finite number",
    ),
    "half an order": (
        lambda x: al.reconstruct(x.run, "three_axis", max_order=1.5),
        "max_order must be a whole number",
    ),
    "a word for false": (
        lambda x: al.reconstruct(x.run, "three_axis", physical="no"),
        "physical must be True or False",
    ),
    "a library in a list": (
        lambda x: al.reconstruct(x.run, "three_axis", library=["rigid-body"]),
        "library must be",
    ),
    "an unknown estimator": (
        lambda x: al.reconstruct(x.run, "three_axis", estimator="x"),
        "unknown estimator 'x'",
    ),
    "laws in one word": (
        lambda x: al.reconstruct(x.run, "three_axis", friction="coulomb"),
        "friction must be a list",
    ),
    "a law that is a number": (
        lambda x: al.reconstruct(x.run, "three_axis", friction=[1]),
        "friction 1 must be a word",
    ),
    "ratios of a time series": (
        lambda x: al.reconstruct(x.run, "three_axis", snr=(60, 40, 20)),
        "snr is for samples that are no time series; give cutoff=0",
    ),
    "ratios in text": (
        lambda x: al.reconstruct(x.run, "three_axis", snr="60,40,20", cutoff=0),
        "snr must be 3 finite",
    ),
    "negative ratios": (
        lambda x: al.reconstruct(x.run, "three_axis", snr=(60, -4, 20), cutoff=0),
        "positive ratios in dB",
    ),
    "ratios for a library that has no use for them": (
        lambda x: al.reconstruct(x.run, "three_axis", snr=(60, 40, 20), cutoff=0, library="rigid-body"),
        "the library double-feature-set",
    ),
    "progress that cannot be called": (
        lambda x: al.excite("three_axis", progress=True),
        "progress must be a function",
    ),
    "a seed in a list": (lambda x: al.excite("three_axis", seed=[1]), "seed must be a whole number"),
    "a seed below zero": (lambda x: al.excite("three_axis", seed=-1), "seed must not be negative"),
    "a duration in text": (
        lambda x: al.excite("three_axis", duration="60"),
        "duration must be a finite number",
    ),
    "one limit for all joints": (
        lambda x: al.excite("three_axis", lower=-1.0),
        "lower must be 3 finite numbers",
    ),
    "limits in text": (lambda x: al.excite("three_axis", lower="111"), "lower must be 3 finite numbers"),
    "limits in a column": (
        lambda x: al.excite("three_axis", upper=np.ones((3, 1))),
        "upper must be 3 finite numbers",
    ),
    "a limit left open": (
        lambda x: al.excite("three_axis", velocity=[1, None, 1]),
        "velocity must be 3 finite",
    ),
    "noise of two joints": (
        lambda x: al.excite("three_axis", noise=[1, 1]),
        "noise must be 3 finite numbers",
    ),
    "a model in text": (lambda x: al.excite("three_axis", model="model.json"), "a model must be one, .* str"),
    "a model of another arm": (
        lambda x: al.excite("scara", model=x.model),
        "made for three_axis with 3 joints",
    ),
    "a billion processes": (
        lambda x: al.diagnose(x.model, x.run, jobs=10**9),
        "jobs 1000000000: .* at most 1024",
    ),
    "processes in text": (lambda x: al.diagnose(x.model, x.run, jobs="2"), "jobs must be a whole number"),
    "a scenario's path that is a log": (lambda x: al.track(x.run), "the scenario must be text"),
    "models by a path": (lambda x: al.track("scenario.yaml", "model.json"), "a model must be one, .* str"),
    "models in a list": (lambda x: al.track("scenario.yaml", [x.model]), "a model must be one, .* list"),
    "a model's path under a name": (
        lambda x: al.track("scenario.yaml", {"a": "model.json"}),
        "a model must be one",
    ),
    "a model without a name": (
        lambda x: al.track("scenario.yaml", {"": x.model}),
        "model '': a name has letters",
    ),
    "a model that is called exact": (
        lambda x: al.track("scenario.yaml", {"exact": x.model}),
        "choose another name",
    ),
    "no seconds to plot": (lambda x: x.model.plot(x.run, seconds=None), "seconds must be a finite number"),
    "arrays in place of a motion": (lambda x: x.model.predict(x.run.q), "predict takes a Motion .*ndarray"),
    "a log in place of a motion": (lambda x: x.model.predict(x.run), r"For a log: model.compare\(log\)"),
    "a step that is none": (
        lambda x: x.model.feedforward(*np.zeros((3, 3)), step=0),
        "step is 0; it must be 1, 2 or 3",
    ),
    "a motion that is nowhere": (
        lambda x: x.model.predict(with_nan(x.motion, "vdot", np.nan)),
        "vdot2 of the motion is nan at sample 3; every number must be finite",
    ),
    "a motion that is everywhere": (
        lambda x: x.model.predict(with_nan(x.motion, "q", -np.inf)),
        "q2 of the motion is -inf at sample 3",
    ),
    "a step of a motion that is none": (lambda x: x.model.predict(x.motion, step=4), "step is 4; it must be"),
    "a motion of nothing": (
        lambda x: x.model.predict(x.motion.take(slice(0, 0))),
        "the motion has no samples",
    ),
    "motions at once": (
        lambda x: x.model.feedforward(*np.zeros((3, 40, 3))),
        r"q must be 3 finite numbers, one per joint; it is of type ndarray and shape \(40, 3\)",
    ),
    "a frame in place of a log": (
        lambda x: x.model.score(Lazy(x.frame)),
        r"a log must be a MotionLog, .* of a data frame, MotionLog\.from_frame; this is of type Lazy",
    ),
    "columns in place of a log": (lambda x: x.model.score(x.frame), r"from_frame; this is of type dict"),
    "a lazy frame": (
        lambda x: al.MotionLog.from_frame(Lazy(x.frame)),
        r"the Lazy gives no column by its name, 'time'; .* its collect\(\) returns",
    ),
    "dates in place of seconds": (
        lambda x: al.MotionLog.from_arrays(x.dates, x.run.q, x.run.tau),
        r"time is no array of numbers \(it holds datetime64\[ns\]\); give seconds as numbers, of dates such as",
    ),
    "dates of Python": (
        lambda x: al.MotionLog.from_arrays(x.dates.astype("M8[us]").astype(object), x.run.q, x.run.tau),
        r"time is no array of numbers \(it holds object\); give seconds as numbers",
    ),
    "torques as objects": (
        lambda x: al.MotionLog.from_arrays(x.run.time, x.run.q, x.run.tau.astype(object)),
        r"tau is no array of numbers \(it holds object\); give real numbers in SI units",
    ),
    "a posture of two joints": (
        lambda x: Dynamics(x.model).mass_matrix([0, 0]),
        r"vectors must all be \(3,\) or \(N, 3\); they are \(2,\)",
    ),
    "a posture that is nowhere": (
        lambda x: Dynamics(x.model).gravity([0.0, np.nan, 0.0]),
        r"vectors must be of finite numbers; one is \[0\.0, nan, 0\.0\]",
    ),
    "a posture in text": (lambda x: Dynamics(x.model).friction("abc"), "of finite numbers; one is 'abc'"),
    "complex postures": (
        lambda x: Dynamics(x.model).torque(*np.zeros((3, 40, 3), complex)),
        r"of finite numbers; one is of type ndarray and shape \(40, 3\)",
    ),
    "friction of no joint": (
        lambda x: exact_model(x.model.arm, []),
        "friction is given for 0 joints; three_axis has 3",
    ),
    "two joints": (
        lambda x: x.model.feedforward([0, 0], np.zeros(3), np.zeros(3)),
        "q must be 3 finite numbers",
    ),
    "a column": (
        lambda x: x.model.feedforward(np.zeros(3), np.zeros((3, 1)), np.zeros(3)),
        "v must be 3 finite",
    ),
    "a speed that friction would take for none": (
        lambda x: x.model.feedforward(np.zeros(3), np.full(3, np.nan), np.zeros(3), step=1),
        "v must be 3 finite numbers",
    ),
    "sliding of two joints": (
        lambda x: x.model.feedforward(*np.zeros((3, 3)), sliding=[0, 0]),
        "sliding must be 3",
    ),
    "a motion without accelerations": (
        lambda x: Motion(x.run.time, x.run.q, x.run.v, None, np.array([0])),
        "vdot of a motion must be an array of numbers; it is of type NoneType",
    ),
    "columns of other lengths": (
        lambda x: al.MotionLog.from_frame({**x.frame, "q2": x.frame["q2"][:-1]}),
        r"q2 has the shape \(1299,\), time \(1300,\)",
    ),
    "a column that is a number": (
        lambda x: al.MotionLog.from_frame({**x.frame, "tau2": 1.0}),
        r"tau2 has the shape \(\)",
    ),
    "q and v exchanged": (
        lambda x: al.MotionLog(x.run.time, x.run.v, x.run.q, x.run.tau),
        r"column v1 has little to do with the rate of q1 \(correlation -0\.[0-9]+\)",
    ),
}


@pytest.fixture
def given(place: Path) -> SimpleNamespace:
    run = al.read_log(CSV)
    frame = {"time": run.time} | {
        f"{kind}{j + 1}": getattr(run, kind)[:, j] for kind in ("q", "v", "tau") for j in range(3)
    }
    motion = Motion(run.time, run.q, run.v, 0 * run.q, np.array([0]))
    dates = np.datetime64("2030-01-01", "ns") + (1e9 * run.time).astype("m8[ns]")
    return SimpleNamespace(
        run=run, model=al.load_model("model.json"), frame=frame, motion=motion, dates=dates
    )


@pytest.mark.parametrize("name", WRONG)
def test_what_is_handed_in_by_mistake(name: str, given: SimpleNamespace, place: Path) -> None:
    call, said = WRONG[name]
    before = contents(place)
    with pytest.raises(InputError, match=said) as refused:
        call(given)
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 1000
    assert contents(place) == before


def test_numbers_of_any_kind_are_numbers(given: SimpleNamespace) -> None:
    q, v, vdot = given.run.q[7], given.run.v[7], np.zeros(3)
    tau = given.model.feedforward(q, v, vdot)
    np.testing.assert_array_equal(given.model.feedforward(q.tolist(), tuple(v), [0, 0, 0]), tau)
    np.testing.assert_allclose(given.model.feedforward(*np.float32([q, v, vdot])), tau, rtol=1e-5)
    motion = given.motion
    lists = Motion(motion.time.tolist(), motion.q.tolist(), motion.v.tolist(), motion.vdot.tolist(), [0])  # type: ignore[arg-type]
    np.testing.assert_array_equal(given.model.predict(lists), given.model.predict(motion))
