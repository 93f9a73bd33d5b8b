"""A log that no arm can have made is refused in one line, from Python as from a file; an honest one never is."""

import json
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.clock import likely_unit
from armloop.data.log import MotionLog, read_log, write_log
from armloop.data.signals import Conditioning, preprocess
from armloop.laws.friction import FrictionLaw
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters
from armloop.util.errors import InputError, InputWarning, LogError

Arrays = dict[str, np.ndarray]


def good(seconds: float = 12.0, rate: float = 100.0, seed: int = 1) -> MotionLog:
    motion = fourier_motion(seconds, rate, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, seed)


def arrays(log: MotionLog) -> Arrays:
    return {key: getattr(log, key).copy() for key in ("time", "q", "v", "tau")}


def put(key: str, where: object, value: object) -> Callable[[Arrays], None]:
    return lambda log: log[key].__setitem__(where, value)


def swap_velocities(log: Arrays) -> None:
    log["v"][:, [0, 2]] = log["v"][:, [2, 0]]


def exchange_joints_that_move_alike(log: Arrays) -> None:
    """Joint 3 does, but for a fifth more of its own, what joint 1 does; their positions are exchanged."""
    for key in ("q", "v"):
        log[key][:, 2] = log[key][:, 0] + 0.6 * log[key][:, 2]
    log["q"][:, [0, 2]] = log["q"][:, [2, 0]]


def freeze(key: str) -> Callable[[Arrays], None]:
    def change(log: Arrays) -> None:
        fast = int(np.argmax(np.abs(log["v"][100:-150, 1]))) + 100
        log[key][fast - 20 : fast + 20, 1] = log[key][fast - 20, 1] if key == "q" else 0.0

    return change


def stick(log: Arrays) -> None:
    """An encoder that is stuck for a second, with a v that is formed of it."""
    fast = int(np.argmax(np.abs(log["v"][100:-150, 1]))) + 100
    log["q"][fast - 50 : fast + 50, 1], log["v"][fast - 49 : fast + 50, 1] = log["q"][fast - 50, 1], 0.0


def noise_for_v(log: Arrays) -> None:
    log["v"][:, 1] = np.random.default_rng(3).normal(size=len(log["v"]))


def scaled(factor: float, *keys: str) -> Callable[[Arrays], None]:
    def change(log: Arrays) -> None:
        for key in keys:
            log[key] *= factor

    return change


def wrap(log: Arrays) -> None:
    log["q"][600:, 2] += 2 * np.pi


WRONG: dict[str, tuple[Callable[[Arrays], None], str]] = {
    "all of v zero": (
        put("v", slice(None), 0.0),
        r"column v1 is zero throughout, while q1 moves by .* leave out",
    ),
    "one column of v zero": (put("v", (slice(None), 1), 0.0), r"column v2 is zero throughout, while q2"),
    "v next to zero": (scaled(1e-3, "v"), r"column v1 is 0.001 times the rate of q1"),
    "q frozen": (put("q", (slice(None), 1), 0.4), r"column q2 stands still throughout, while v2 reaches"),
    "q frozen for a while": (
        freeze("q"),
        r"column q2, row \d+.* stands still for 0.39 s .*while v2 adds up to",
    ),
    "v zero for a while": (freeze("v"), r"column v2, row \d+.* is zero for 0.4 s .*while q2 moves by"),
    "q and v frozen for a while": (
        stick,
        r"column q2, row \d+.* stands still to the last digit for 0.99 s .* jumps by .* stuck; drop these rows",
    ),
    "v in another order": (swap_velocities, r"column v1 is not the rate of q1 .* v3 is"),
    "joints that move alike, exchanged": (
        exchange_joints_that_move_alike,
        r"column v1 is not the rate of q1 .* v3 is",
    ),
    "v of something else": (noise_for_v, r"column v2 has little to do with the rate of q2"),
    "v of the other sign": (scaled(-1.0, "v"), r"column v1 is -1 times .* opposite sign"),
    "a spike of q": (put("q", (500, 1), 1e6), r"column q2, row 501.* holds 1e\+06, more than any arm"),
    "a small spike of q": (put("q", (500, 1), 40.0), r"column q2, row 501.* spike of 40"),
    "a spike of tau": (put("tau", (500, 0), 1e11), r"column tau1, row 501.* holds 1e\+11"),
    "a small spike of tau": (put("tau", (500, 0), -3e3), r"column tau1, row 501.* spike of -3000"),
    "a spike of v": (put("v", (500, 2), 1e5), r"column v3, row 501.* holds 100000"),
    "a wrapped angle": (wrap, r"column q3, row 601.* jumps by 6\.\d+ .* unwrap"),
    "degrees": (scaled(180 / np.pi, "q", "v"), r"columns q1, v1 reach .* convert degrees"),
    "q in degrees": (scaled(180 / np.pi, "q"), r"as if q were in degrees"),
    "time backwards": (lambda log: log.update(time=log["time"][::-1].copy()), r"time must rise strictly"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_python_and_the_command_line_refuse_the_same(tmp_path: Path, fault: str) -> None:
    change, expected = WRONG[fault]
    log = arrays(good())
    change(log)
    with pytest.raises(LogError, match=expected) as caught:
        MotionLog(**log, name="run")
    assert str(caught.value).startswith("run: ")
    header = ",".join(["time", *(f"{kind}{j}" for kind in ("q", "v", "tau") for j in (1, 2, 3))])
    table = np.column_stack([log["time"], log["q"], log["v"], log["tau"]])
    path = tmp_path / "run.csv"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.12g")
    with pytest.raises(LogError, match=expected) as caught:
        read_log(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


MISSHAPEN: dict[str, tuple[dict[str, object], str]] = {
    "NaN": ({"q": [[0.0], [np.nan], [0.1]]}, r"q of joint 1, row 2: nan is not a finite number"),
    "infinite time": ({"time": [0.0, 1.0, np.inf]}, r"time, row 3: inf is not a finite number"),
    "text": ({"tau": [["a"], ["b"], ["c"]]}, r"tau is no array of numbers"),
    "ragged": ({"v": [[0.0], [0.1, 0.2], [0.0]]}, r"v is no array of numbers"),
    "None": ({"v": None}, r"v is no array of numbers"),
    "a flat q": ({"q": [0.0, 0.1, 0.2]}, r"time must be \(N,\) and q \(N, n\)"),
    "complex": ({"tau": np.ones((3, 1)) * 1j}, r"tau is no array of numbers"),
    "another length": ({"tau": [[0.0], [0.1]]}, r"tau must have the shape of q"),
    "nothing": (
        {"time": [], "q": np.zeros((0, 1)), "v": np.zeros((0, 1)), "tau": np.zeros((0, 1))},
        r"samples",
    ),
    "no joint": ({key: np.zeros((3, 0)) for key in ("q", "v", "tau")}, r"a log has samples and joints"),
    "a unit": ({"tau_unit": "Nm"}, r"tau unit 'Nm' is unknown"),
}


@pytest.mark.parametrize("fault", MISSHAPEN)
def test_what_is_no_log_is_one_input_error(fault: str) -> None:
    change, expected = MISSHAPEN[fault]
    fine = {"time": [0.0, 0.1, 0.2], "q": [[0.0], [0.1], [0.2]], "v": [[1.0]] * 3, "tau": [[2.0]] * 3}
    with pytest.raises(InputError, match=expected) as caught:
        MotionLog(**{**fine, **change})
    assert "\n" not in str(caught.value)


def test_lists_are_converted() -> None:
    log = good()
    same = MotionLog(log.time.tolist(), log.q.tolist(), log.v.tolist(), log.tau.astype(np.float32).tolist())
    np.testing.assert_array_equal(same.q, log.q)
    assert same.tau.dtype == np.float64 and same.joints == 3
    whole = MotionLog.from_arrays(range(3), [[0], [1], [2]], [[5], [5], [5]], v=[[1], [1], [1]])
    assert whole.q.dtype == np.float64


def test_five_samples_a_second_are_enough_however_their_times_are_rounded() -> None:
    for rate in (5.0, 5.0 * (1 - 1e-9), 2e4 * (1 + 1e-9)):
        assert likely_unit(rate) is None
    assert likely_unit(4.99) == ("milliseconds", pytest.approx(4990.0))


@pytest.mark.parametrize(("ticks", "unit"), [(1 / 3600, "hours"), (1 / 86400, "days")])
@pytest.mark.parametrize("derived", [False, True])
def test_times_of_coarse_clocks_are_refused(ticks: float, unit: str, derived: bool) -> None:
    """Days as MATLAB and spreadsheets count them."""
    log = good()
    expected = rf"column time has .* samples a second, as if it were in {unit} \(100 Hz\); .* at most"
    with pytest.raises(LogError, match=expected):
        MotionLog.from_arrays(ticks * log.time, log.q, log.tau, v=None if derived else log.v, name="run")


def test_times_in_minutes_are_doubted_where_no_v_tells() -> None:
    log = good()
    expected = r"column time has 6e\+03 samples a second, more than recorders of arms take"
    with pytest.warns(InputWarning, match=expected):
        MotionLog.from_arrays(log.time / 60, log.q, log.tau, name="run")


@pytest.mark.parametrize(
    ("ticks", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")]
)
def test_times_that_are_no_seconds_are_refused_where_no_v_tells(
    tmp_path: Path, ticks: float, unit: str
) -> None:
    log = good()
    expected = rf"column time has .* samples a second, as if it were in {unit} \(100 Hz\); time must be in s"
    with pytest.raises(LogError, match=expected):
        MotionLog.from_arrays(ticks * log.time, log.q, log.tau, name="run")
    names = ["time", *(f"{kind}{j}" for kind in ("q", "tau") for j in (1, 2, 3))]
    table, path = np.column_stack([ticks * log.time, log.q, log.tau]), tmp_path / "run.csv"
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    with pytest.raises(LogError, match=expected):
        read_log(path)
    table[:, 0] += 1.75e9 * ticks
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.18g")
    with pytest.raises(LogError, match=rf"time, row 1 .*too large a number; .* in s, and looks like {unit}"):
        read_log(path)


@pytest.mark.parametrize("ticks", [1e3, 1e9])
def test_times_that_are_no_seconds_are_named_before_the_rates_that_they_put_off(ticks: float) -> None:
    log = good()
    with pytest.raises(LogError, match=r"column time has .*, as if it were in"):
        MotionLog(ticks * log.time, log.q, log.v, log.tau)


def test_independent_samples_are_no_motion_and_pass() -> None:
    rng = np.random.default_rng(0)
    q, v = rng.uniform(-2, 2, (400, 3)), rng.uniform(-1, 1, (400, 3))
    for rates in (v, 0 * v):
        log = MotionLog(1e-3 * np.arange(400), q, rates, q, vdot=rates)
        assert log.doubts() == []


def test_independent_samples_of_which_a_joint_stands_still_pass() -> None:
    """The ranks of equal numbers rise with their rows."""
    rng = np.random.default_rng(0)
    q, v = rng.uniform(-2, 2, (400, 3)), rng.uniform(-1, 1, (400, 3))
    q[:, 2] = v[:, 2] = 0.0
    for each in (q, np.zeros((400, 3))):
        log = MotionLog(1e-3 * np.arange(400), each, 0 * v, rng.normal(size=(400, 3)), vdot=v)
        assert log.samples == 400


def test_without_v_it_is_differentiated_from_q(tmp_path: Path) -> None:
    log = good()
    path = tmp_path / "run.csv"
    write_log(path, log)
    rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join(",".join(row[:4] + row[7:]) for row in rows) + "\n")
    with pytest.warns(InputWarning, match="columns v are missing; v is the derivative of q"):
        read = read_log(path, joints=3)
    assert read.v_derived and not log.v_derived
    ten = Conditioning()
    with_v, without = preprocess([log], ten), preprocess([read], ten)
    size = np.sqrt(np.mean(with_v.motion.v**2))
    assert np.sqrt(np.mean((with_v.motion.v - without.motion.v) ** 2)) < 0.02 * size
    write_log(tmp_path / "again.csv", read)  # what was not measured is not written as if it had been
    assert "v1" not in (tmp_path / "again.csv").read_text().splitlines()[0]
    rows[0][4] = "speed1"
    path.write_text("\n".join(",".join(row[:5] + row[7:]) for row in rows) + "\n")
    read_log(path, quiet=True)
    rows[0][4] = "v1"
    path.write_text("\n".join(",".join(row[:5] + row[7:]) for row in rows) + "\n")
    with pytest.raises(LogError, match="the header lacks v2, v3"):
        read_log(path)


def torque(log: MotionLog, tau2: np.ndarray) -> list[str]:
    """What is doubtful about a log with another torque of joint 2."""
    tau = log.tau.copy()
    tau[:, 1] = tau2
    return replace(log, tau=tau).doubts()


def test_a_torque_that_never_changes_is_said_where_its_joint_moves() -> None:
    log = good()
    for value in (0.0, 7.25):
        said = torque(log, np.full(log.samples, value))
        assert [line for line in said if line.startswith(f"column tau2 is {value:g} throughout, though")]
    held = log.q.copy()
    held[:, 1] = 0.3
    still = MotionLog(log.time, held, log.v * [1, 0, 1], log.tau * [1, 0, 1])
    assert not [line for line in still.doubts() if "throughout" in line]


def test_a_torque_that_is_cut_off_is_said_at_either_end() -> None:
    log = good()
    own = log.tau[:, 1] - np.median(log.tau[:, 1])
    high, low = np.quantile(own, [0.9, 0.1])
    (above,) = torque(log, np.minimum(own, high))
    (below,) = torque(log, np.maximum(own, low))
    for doubt, value in ((above, high), (below, low)):
        assert doubt.startswith(f"column tau2 is {value:.6g} to the last digit in 10% of the rows")


def test_torques_that_stay_at_their_extreme_by_themselves_pass() -> None:
    log = good()
    own = log.tau[:, 1] - np.median(log.tau[:, 1])
    coarse, size = np.ptp(own) / 30, np.ptp(own)
    swing = size * np.sin(
        2 * log.time
    )  # its ends take long: a fifteenth of the time in the last of 200 levels
    honest = {
        "for a moment": np.minimum(own, np.quantile(own, 0.9915)),
        "by a coarse sensor": coarse * np.round(np.minimum(own, np.quantile(own, 0.4)) / coarse),
        "rounded at a slow turn": size / 100 * np.round(swing / size * 100),
        "at nothing": np.maximum(own, 0.0),
    }
    for name, tau2 in honest.items():
        assert torque(log, tau2) == [], name
    still = replace(log, q=0 * log.q, v=0 * log.v)
    assert not any("saturates" in doubt for doubt in torque(still, np.minimum(own, np.quantile(own, 0.9))))


@pytest.mark.parametrize("milliseconds", [-6.0, 5.0, 12.0])
def test_v_that_lags_is_said_with_the_lag(milliseconds: float) -> None:
    log = good(rate=250.0)
    late = np.stack([np.interp(log.time - 1e-3 * milliseconds, log.time, v) for v in log.v.T], axis=1)
    (doubt,) = replace(log, v=late).doubts()
    word = "lag behind" if milliseconds > 0 else "lead"
    assert doubt.startswith(f"columns v {word} dq/dt by ")
    assert float(doubt.split(" by ")[1].split()[0]) == pytest.approx(abs(milliseconds), abs=0.1)
    assert ("they are taken to be that late" in doubt) == (milliseconds > 0)
    assert log.doubts() == []


def test_doubts_are_said_after_the_work_and_in_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slow = good(seconds=60.0, rate=20.0)
    write_log(tmp_path / "slow.csv", slow)
    assert main(["cluster", str(tmp_path / "slow.csv"), "--json"]) == 0
    out, err = capsys.readouterr()
    (warning,) = json.loads(out)["warnings"]
    assert "20 samples a second" in warning and str(tmp_path / "slow.csv") in warning
    # no more is asked for than what nothing is said of
    assert "need 50 or more, better 100" in warning
    assert good(seconds=60.0, rate=50.0).doubts() == []
    assert err == f"armloop: warning: {warning}\n"


@pytest.mark.parametrize("command", ["crossvalidate", "reconstruct", "diagnose"])
def test_commands_refuse_the_same_log_twice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    write_log(tmp_path / "a.csv", good())
    write_log(tmp_path / "b.parquet" if command == "crossvalidate" else tmp_path / "b.csv", good())
    logs = [str(path) for path in sorted(tmp_path.glob("*.*"))]
    arguments = [*logs, "--arm", "three_axis"]
    if command == "diagnose":
        body = RigidBody(nominal_parameters(three_axis()), ("m1",), np.ones(1))
        ReconstructedModel(three_axis(), (body,), FrictionLaw(((), (), ()))).save(tmp_path / "model.json")
        arguments = [str(tmp_path / "model.json"), *logs]
    if command != "crossvalidate":
        arguments += ["--out", str(tmp_path / "out")]
    assert main([command, *arguments]) == 2
    assert "give each measurement once" in capsys.readouterr().err


def test_the_origin_of_time_does_not_matter(tmp_path: Path) -> None:
    log = good(seconds=20.0, rate=500.0)
    found = []
    for origin in (0.0, -1000.0, 1.7e9):
        samples = preprocess([replace(log, time=log.time + origin)], Conditioning())
        found.append(samples)
        assert samples.motion.time[0] == pytest.approx(origin + 0.05, abs=1e-6)
    for other in found[1:]:
        assert other.motion.samples == found[0].motion.samples
        for key in ("q", "v", "vdot"):
            scale = np.abs(getattr(found[0].motion, key)).max()
            np.testing.assert_allclose(
                getattr(other.motion, key), getattr(found[0].motion, key), atol=1e-7 * scale
            )


def test_a_first_sample_before_a_gap_is_left_out() -> None:
    log = good()
    time = log.time.copy()
    time[0] -= 5.0
    samples = preprocess([replace(log, time=time)], Conditioning())
    whole = preprocess([log.select(slice(1, None))], Conditioning())
    np.testing.assert_array_equal(samples.motion.q, whole.motion.q)


def test_a_jittered_clock_passes() -> None:
    log = good(rate=250.0)
    rng = np.random.default_rng(5)
    time = log.time + 1e-3 * rng.uniform(-1, 1, log.samples)
    jittered = {
        key: np.stack([np.interp(time, log.time, x) for x in getattr(log, key).T], 1) for key in ("q", "v")
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert MotionLog(time, jittered["q"], jittered["v"], log.tau).doubts() == []


@pytest.mark.measured
def test_no_measured_log_is_accused(measured: Path) -> None:
    for path in sorted(measured.glob("*/*.csv")):
        if path.name.endswith(".truth.csv"):
            continue
        doubts = read_log(path, quiet=True).doubts()
        lags = [doubt for doubt in doubts if "lag behind" in doubt]
        slow = [doubt for doubt in doubts if "samples a second" in doubt]
        repeats = [doubt for doubt in doubts if "repeat the row before in 600 rows" in doubt]
        assert len(lags) + len(slow) + len(repeats) == len(doubts), doubts
        assert bool(repeats) == (path.parent.name == "panda"), path  # one row in seventeen
        # the README of the Panda states 5 ms; the controller PILCO logs at 33 Hz with backward differences
        assert bool(lags) == (path.parent.name == "panda" or "pilco" in path.name), path
        assert bool(slow) == ("pilco" in path.name), path


@pytest.mark.parametrize("rows", [slice(0, 1), slice(-2, None)])
def test_a_step_whose_other_side_is_missing_is_no_spike(rows: slice) -> None:
    """A joint turns round in a log's last row, and its dry friction with it; what is far larger than all else is one."""
    log = good()
    tau = np.full_like(log.tau, -1.2) + 0.01 * log.v
    tau[rows, 1] = 1.2
    MotionLog(log.time, log.q, log.v, tau)
    tau[rows, 1] = 40.0
    with pytest.raises(LogError, match=r"column tau2, row .* has a spike of 40, while all else lies within"):
        MotionLog(log.time, log.q, log.v, tau)
