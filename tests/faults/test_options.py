"""Options that cannot be: one line before any work, within seconds."""

import re
from pathlib import Path

import pytest
from faults.conftest import contents, one_line

from armloop.cli import main
from armloop.data.log import MotionLog, read_log, write_log

RECONSTRUCT = "reconstruct run.csv --arm three_axis --out m.json"
EXCITE = "excite three_axis --out r.csv"
DIAGNOSE = "diagnose model.json run.csv --out d"
WRONG: dict[str, tuple[str, str]] = {
    "no address": (f"{RECONSTRUCT} --scheduler nonsense", "no Dask scheduler answers"),
    "half an address": (f"{RECONSTRUCT} --scheduler tcp://", "no Dask scheduler answers"),
    "no port": (f"{RECONSTRUCT} --scheduler tcp://127.0.0.1", "no Dask scheduler answers"),
    "a port that is none": (f"{RECONSTRUCT} --scheduler tcp://127.0.0.1:99999", "no Dask scheduler answers"),
    "nobody at the port": (f"{RECONSTRUCT} --scheduler tcp://127.0.0.1:1", "no Dask scheduler answers"),
    "another protocol": (f"{RECONSTRUCT} --scheduler http://127.0.0.1:80", "no Dask scheduler answers"),
    "a name of no host": (f"{RECONSTRUCT} --scheduler {'x' * 300}:80", "no Dask scheduler answers"),
    "a model that is its report": (f"{RECONSTRUCT} --report ./m.json", "is given to --out and to --report"),
    "a reference that is its report": (f"{EXCITE} --report r.csv", "is given to --out and to --report"),
    "a locked built-in arm": (
        f"{EXCITE} --lock joint_3=0.2 --lower 1,1 --upper 0,0",
        "three_axis: .*lower below upper|three_axis: .*must be below",
    ),
    "a gain of 1e300": (f"{RECONSTRUCT} --drive-gains 1e300,1,1", "every gain must be .*1e-06 to 1e\\+06"),
    "a gain of 1e-300": (f"{RECONSTRUCT} --drive-gains 1e-300,1,1", "every gain must be a positive"),
    "no jobs": (f"{RECONSTRUCT} --jobs 0", "--jobs: '0' is no number of processes"),
    "negative jobs": (f"{RECONSTRUCT} --jobs -3", "--jobs: '-3' is no number of processes"),
    "half a job": (f"{RECONSTRUCT} --jobs 0.5", "--jobs"),
    "a billion jobs": (f"{DIAGNOSE} --jobs 1000000000", "--jobs: '1000000000' is no number of processes"),
    "endless jobs": (f"{DIAGNOSE} --jobs {'9' * 5000}", "is no number of processes"),
    "no penalty": (f"{RECONSTRUCT} --penalty 0", "--penalty 0"),
    "a penalty of nan": (f"{RECONSTRUCT} --penalty nan", "--penalty nan"),
    "an infinite penalty": (f"{RECONSTRUCT} --penalty inf", "--penalty inf"),
    "order 0": (f"{RECONSTRUCT} --max-order 0", "--max-order 0"),
    "order 99": (f"{RECONSTRUCT} --max-order 99", "--max-order 99"),
    "a negative cutoff": (f"{RECONSTRUCT} --cutoff -1", "--cutoff -1"),
    "a cutoff of nan": (f"{RECONSTRUCT} --cutoff nan", "--cutoff nan"),
    "a cutoff of hours": (
        f"{RECONSTRUCT} --cutoff 1e-9",
        "--cutoff 1e-09: give a frequency from 0.001 to 10000 Hz",
    ),
    "a home that no shell put there": (
        "reconstruct run.csv --arm three_axis --out ~/m.json",
        "~/m.json: ~ stands for no folder",
    ),
    "a folder in such a home": ("collect three_axis --out ~/logs", "~/logs: ~ stands for no folder"),
    "a path longer than any": (f"{RECONSTRUCT} --report {'d/' * 2100}r.html", "d/d/.* … .*too long"),
    "standard output for a model": (
        f"{RECONSTRUCT[:-6]} -",
        "-: --out cannot be standard output; give a file's name",
    ),
    "standard output for an export": (
        "export model.json --to c --out -",
        "-: --out cannot be standard output",
    ),
    "standard output for a bundle": (
        "export model.json --to drake --out -",
        "-: .* cannot be standard output",
    ),
    "standard output for logs": ("collect three_axis --out -", "-: --out cannot be standard output"),
    "an infinite cutoff": (f"{RECONSTRUCT} --cutoff inf", "--cutoff inf"),
    "an unknown estimator": (f"{RECONSTRUCT} --estimator magic", "unknown estimator 'magic'"),
    "a penalty of nothing": (f"{RECONSTRUCT} --penalty 0.1", "estimator 'evidence' has no penalty; .* lasso"),
    "an unknown option": (
        f"{RECONSTRUCT} --magic",
        "reconstruct: unrecognized arguments: --magic; see armloop reconstruct --help",
    ),
    "gains for torques": (f"{RECONSTRUCT} --tau-unit N*m --drive-gains 1,1,1", "--drive-gains turn currents"),
    "gains that are words": (f"{RECONSTRUCT} --drive-gains a,b,c", "--drive-gains 'a,b,c'"),
    "a gain of zero": (f"{RECONSTRUCT} --drive-gains 0,1,1", "every gain must be a positive"),
    "a gain of inf": (f"{RECONSTRUCT} --drive-gains inf,1,1", "every gain must be a positive"),
    "a gain below zero": (f"{RECONSTRUCT} --drive-gains=-1,1,1", "turns against its joint .*armloop convert"),
    "ratios of two": (f"{RECONSTRUCT} --snr 60,40 --cutoff 0", "give three numbers in dB"),
    "a ratio of nan": (f"{RECONSTRUCT} --snr nan,40,20 --cutoff 0", "ratios in dB must be positive"),
    "ratios of a time series": (f"{RECONSTRUCT} --snr 60,40,20", "give --cutoff 0 with it"),
    "a billion references": (f"{EXCITE} --random 1000000000", "random 1000000000"),
    "two references": (f"{EXCITE} --random 2", "random 2"),
    "a million starts": (f"{EXCITE} --starts 1000000", "--starts 1000000"),
    "no rows": (f"{EXCITE} --rate 0", "--rate 0"),
    "rows without end": (f"{EXCITE} --rate 1e9", "--rate 1e"),
    "a rate of nan": (f"{EXCITE} --rate nan", "--rate nan"),
    "a duration without end": (f"{EXCITE} --duration 1e9", "duration 1e"),
    "a duration of nan": (f"{EXCITE} --duration nan", "duration nan"),
    "a thousand harmonics": (f"{EXCITE} --harmonics 100000", "harmonics 100000"),
    "order 9": (f"{EXCITE} --order 9", "order 9"),
    "a negative frequency": (f"{EXCITE} --base-frequency -1", "base frequency -1"),
    "all reserved": (f"{EXCITE} --reserve 1", "reserve 1"),
    "an unknown criterion": (f"{EXCITE} --criterion magic", "magic"),
    "an unknown library": (f"{EXCITE} --library magic", "magic"),
    "noise of two joints": (f"{EXCITE} --noise 1,1", "--noise '1,1'"),
    "noise of nan": (f"{EXCITE} --noise nan,1,1", "--noise"),
    "another suffix": ("excite three_axis --out r.txt", "a reference ends in"),
    "a negative seed": (f"{EXCITE} --seed -1", "no seed"),
    "a seed of more than 32 bits": (
        "cluster run.csv --seed 4294967296",
        "from 0 to 4294967295",
    ),
    "a seed without end": (f"cluster run.csv --seed {'9' * 5000}", "no seed"),
    "no noise": (f"{EXCITE} --noise 0,1,1", "noise must be 3 positive numbers"),
    "noise without end": (f"{EXCITE} --noise 1e300,1,1", "noise must be 3 positive numbers"),
    "a log twice": ("cluster run.csv ./run.csv", "holds the measurement of run once more"),
    "half a seed": ("collect three_axis --out c --seed 0.5", "no seed"),
    "an unknown plan": (
        "collect three_axis --out c --plan huge",
        "there are: dwell, paper, quick, simulation$",
    ),
    "an unknown arm": ("collect puma --out c", "puma: no such file and no built-in arm"),
    "the run held out, too": (f"{DIAGNOSE} --held-out run.csv", "is one of the logs diagnosed"),
    "a run held out twice": (f"{DIAGNOSE} --held-out other.csv other.csv", "measurement of other once more"),
    "a reserve without a next run": (f"{DIAGNOSE} --reserve 0.5", "give it, too"),
    "ranges without a next run": (f"{DIAGNOSE} --next-run-duration 60", "give it, too"),
    "a next run that is no table": (f"{DIAGNOSE} --next-run n.txt", "a reference ends in"),
    "no block": ("crossvalidate run.csv other.csv --arm three_axis --block 0", "--block 0"),
    "a block of nan": ("crossvalidate run.csv --arm three_axis --block nan", "--block nan"),
    "blocks that are not used": (
        "crossvalidate run.csv other.csv --arm three_axis --block 2",
        "of several logs each is left out whole; add --leave-out blocks",
    ),
    "a packed log": ("cluster run.csv.gz", r"run\.csv\.gz: is packed; unpack it first"),
    "a packed log to learn from": (
        "reconstruct RUN.CSV.GZ --arm three_axis --out m.json",
        r"RUN\.CSV\.GZ: is packed; unpack it first",
    ),
    "no draws": ("reproduce table2 --out r --draws 0", "--draws 0"),
    "a million draws": ("reproduce table2 --out r --draws 1000000", "--draws 1000000"),
    "an unknown item": ("reproduce fig99 --out r", "unknown item 'fig99'"),
    "a model without a name": ("track scenario.yaml --model model.json", "write NAME=MODEL.json"),
    "a model twice": ("track scenario.yaml --model a=model.json --model a=model.json", "'a' is given twice"),
    "a model for nobody": (
        "track scenario.yaml --model model=model.json",
        "model .model.: no controller of scenario .pid. would run with it",
    ),
    "the exact model": ("track scenario.yaml --model exact=model.json", "choose another name"),
    "a pace without a view": ("track scenario.yaml --rate 2", "--rate is the pace of --meshcat"),
    "a lock without an arm": (f"{DIAGNOSE} --lock joint_1=0", "--lock is of the URDF that --arm names"),
    "a tip without an arm": (
        "evaluate model.json run.csv --tip tool",
        "--tip is of the URDF that --arm names",
    ),
    "a joint locked twice": (f"{RECONSTRUCT} --lock joint_1=0 --lock joint_1=1", "'joint_1' is locked twice"),
    "a watch without a scheduler": (
        "watch --models model.json --logs run.csv --store s --scheduler nonsense",
        "no Dask scheduler answers",
    ),
    "a store of no text": ("watch --models model.json --logs run.csv --store s\udcff", "the name is no text"),
    "an arm without a page": (
        "watch --models model.json --logs run.csv --store s --arm a",
        "--arm .* page of --report",
    ),
    "an angle of another unit": (
        "convert run.csv --angle-unit deg --out c.csv",
        "--angle-unit deg, but the motion log says itself that q is in rad",
    ),
    "no command": ("", "required: COMMAND"),
    "an unknown command": ("magic", "magic"),
    "an arm that is a folder": (
        "collect . --out c",
        r"^armloop: \.: is a folder; give the path of a URDF in it$",
    ),
    "an arm that is a device": ("collect /dev/null --out c", "no such file"),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_option_that_cannot_be(name: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command, said = WRONG[name]
    before = contents(place)
    assert main(command.split()) == 2
    answer = capsys.readouterr()
    assert answer.out == ""
    assert answer.err.startswith("armloop: ") and answer.err.count("\n") == 1, answer.err
    assert re.search(said, answer.err), answer.err
    assert contents(place) == before


def test_a_log_of_fewer_joints_is_told_the_arms(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = read_log(place / "run.csv")
    write_log(place / "two.csv", MotionLog(log.time, log.q[:, :2], log.v[:, :2], log.tau[:, :2], name="two"))
    said = r"^armloop: two\.csv: the columns are those of 2 joints; the arm has 3: joint_1, joint_2, joint_3, base to tip"
    lock = "; fix those that the log has not with --lock JOINT=VALUE$"
    for command, more in (
        ("reconstruct two.csv --arm arm.urdf --out m.json", lock),
        ("crossvalidate two.csv --arm arm.urdf", lock),
        ("evaluate model.json two.csv", "$"),
        ("export model.json --to urdf --out e.urdf --log two.csv", "$"),
    ):
        assert main(command.split()) == 2
        one_line(capsys.readouterr().err, said + more)


def test_a_variable_of_the_shell_that_is_not_set(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It leaves text of nothing, which must not pass for an option that was left out."""
    empty: dict[str, list[str]] = {
        "--arm": ["evaluate", "model.json", "run.csv", "--arm", ""],
        "LOG": ["evaluate", "model.json", "run.csv", ""],
        "MODEL.json": ["evaluate", "", "run.csv"],
        "--out": ["track", "scenario.yaml", "--out", " "],
        "--report": [*RECONSTRUCT.split(), "--report", ""],
        "--ranges": [*DIAGNOSE.split(), "--next-run", "n.csv", "--ranges", ""],
        "--logs": ["watch", "--models", "model.json", "--logs", "", "--store", "s"],
    }
    before = contents(place)
    for name, words in empty.items():
        assert main(words) == 2
        one_line(capsys.readouterr().err, f"{name} is empty; give a value, or leave it out")
    assert contents(place) == before


def test_an_output_without_a_name(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("", " "):
        for words in (RECONSTRUCT.split()[:-1], "collect three_axis --out".split()):
            assert main([*words, name]) == 2
            one_line(capsys.readouterr().err, "--out is empty; give a value, or leave it out")
