"""LeRobot data sets as their writers lay them out, and ones whose names or rows do not fit: no row slips, and no joint is
paired with another's torque."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from foreign_logs import NAMES, assert_same, motion
from synthetic import three_axis

from armloop.convert import Answers, Mapping, QuantityMap, TimeMap, convert
from armloop.data.log import MotionLog
from armloop.util.errors import InputError

JOINTS = ["waist", "shoulder", "elbow"]
ASKED = Answers(tau_unit="N*m", angle_unit="rad")


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return motion()


def data_set(folder: Path, log: MotionLog, names: dict[str, list[str]], **lists: list) -> Path:
    (folder / "meta").mkdir(parents=True)
    (folder / "data").mkdir()
    features = {f"observation.{name}": {"names": entries} for name, entries in names.items()}
    (folder / "meta" / "info.json").write_text(json.dumps({"fps": 100, "features": features}))
    cells = {"state": log.q.tolist(), "velocity": log.v.tolist(), "effort": log.tau.tolist()} | lists
    columns = {f"observation.{name}": pa.array(rows) for name, rows in cells.items()}
    pyarrow.parquet.write_table(pa.table(columns | {"timestamp": log.time}), folder / "data" / "one.parquet")
    return folder


@pytest.mark.parametrize("fault", [None, [0.0, 0.0]])
def test_a_row_without_its_entries_is_named(tmp_path, log, fault):
    rows = log.q.tolist()
    # as many numbers as there should be, so that only the rows between have slipped
    rows[7:10] = [fault, rows[8], rows[9] + [0.0] * (3 - len(fault or []))]
    folder = data_set(
        tmp_path / "set", log, {"state": JOINTS, "effort": JOINTS, "velocity": JOINTS}, state=rows
    )
    with pytest.raises(InputError, match=r"column observation.state/waist, row 8: not a number \(2 of 600\)"):
        convert([folder], answers=ASKED)


@pytest.mark.parametrize("efforts", [["shoulder", "elbow", "lift"], ["motor_3", "motor_2", "motor_1"]])
def test_an_effort_of_no_position_asks_for_a_map(tmp_path, log, efforts):
    names = {"state": JOINTS, "velocity": JOINTS, "effort": efforts}
    folder = data_set(tmp_path / "set", log, names)
    said = rf"observation.effort/{efforts[-1]} belong to no position by name, .*--map"
    with pytest.raises(InputError, match=said):
        convert([folder], answers=ASKED)
    columns = {kind: [f"observation.{kind}/{name}" for name in entries] for kind, entries in names.items()}
    mapping = Mapping(
        TimeMap("timestamp", "s"),
        QuantityMap(columns["state"], "rad"),
        QuantityMap(columns["effort"], "N*m"),
        QuantityMap(columns["velocity"], "rad/s"),
    )
    assert_same(convert([folder], mapping=mapping).log, log)


@pytest.mark.parametrize("velocities", [["elbow", "waist", "lift"], ["a", "b", "c"]])
def test_velocities_of_other_joints_are_not_taken(tmp_path, log, velocities):
    names = {"state": JOINTS, "effort": JOINTS, "velocity": velocities}
    found = convert([data_set(tmp_path / "set", log, names)], answers=ASKED)
    assert any("central differences" in note for note in found.notes)
    np.testing.assert_allclose(found.log.v, log.v, atol=0.05)


def lerobot(folder: Path, log: MotionLog, unit: float) -> Path:
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    turn = [2, 0, 1]
    names = [f"{NAMES[j]}.pos" for j in turn]
    features = {
        "observation.state": {"names": names},
        "observation.effort": {"names": [f"{NAMES[j]}" for j in turn]},
    }
    (folder / "meta" / "info.json").write_text(json.dumps({"fps": 100, "features": features}))
    half = log.samples // 2
    for k, rows in enumerate((slice(0, half), slice(half, None))):
        table = pa.table(
            {
                "observation.state": list(unit * log.q[rows][:, turn]),
                "observation.effort": list(log.tau[rows][:, turn]),
                "timestamp": log.time[rows] - log.time[rows][0],
                "episode_index": np.full(len(log.time[rows]), k),
            }
        )
        pyarrow.parquet.write_table(table, folder / "data" / "chunk-000" / f"episode_{k:06d}.parquet")
    return folder


def test_lerobot_episodes_are_runs_and_degrees_are_asked_for(tmp_path, log):
    folder = lerobot(tmp_path / "set", log, 180 / np.pi)
    with pytest.raises(InputError, match=r"--tau-unit.*--angle-unit"):
        convert([folder], arm=three_axis())
    found = convert([folder], arm=three_axis(), answers=Answers(tau_unit="N*m", angle_unit="deg"))
    assert len(found.log.runs()) == 2
    np.testing.assert_allclose(found.log.q, log.q, atol=1e-9)
    np.testing.assert_allclose(found.log.tau, log.tau, atol=1e-9)
    assert np.abs(found.log.v - log.v)[5:-5].max() < 0.05  # differenced, within and not across the episodes
    assert any("central differences" in note for note in found.notes)
    one = convert(
        [folder / "data/chunk-000/episode_000001.parquet"],
        arm=three_axis(),
        answers=Answers("N*m", None, "deg"),
    )
    np.testing.assert_allclose(one.log.q, log.q[300:], atol=1e-9)


def test_a_map_says_where_a_lerobot_set_has_its_torques(tmp_path, log):
    folder = lerobot(tmp_path / "set", log, 1.0)
    info = folder / "meta" / "info.json"
    info.write_text(info.read_text().replace("observation.effort", "observation.gauge"))
    for path in (folder / "data").rglob("*.parquet"):
        table = pyarrow.parquet.read_table(path)
        names = [name.replace("effort", "gauge") for name in table.column_names]
        pyarrow.parquet.write_table(table.rename_columns(names), path)
    with pytest.raises(InputError, match=r"no torques or currents among .*observation.gauge.*--map"):
        convert([folder], arm=three_axis())
    mapping = Mapping(
        TimeMap("timestamp", "s"),
        QuantityMap([f"observation.state/{name}.pos" for name in NAMES], "rad"),
        QuantityMap([f"observation.gauge/{name}" for name in NAMES], "N*m"),
    )
    found = convert([folder], arm=three_axis(), mapping=mapping)
    np.testing.assert_allclose(found.log.tau, log.tau, atol=1e-9)


@pytest.mark.parametrize("shape", ["v2 motors", "v3 nested", "v3 state with everything"])
def test_lerobot_as_its_writers_lay_it_out(tmp_path, log, shape):
    """v2: a file per episode, names under `motors`; v3: episodes below each other, names in a list of a list.

    float32 throughout, a clock that starts anew, a gripper among the joints, images and flags beside them.
    """
    (tmp_path / "meta").mkdir()
    (tmp_path / "data" / "chunk-000").mkdir(parents=True)
    turn, grip = [1, 2, 0], 0.5 + 0 * log.q[:, :1]
    joints = [NAMES[j] for j in turn]
    state = np.hstack([log.q[:, turn], grip])
    columns = {"observation.state": state, "observation.effort": np.hstack([log.tau[:, turn], grip])}
    names: object = {"motors": [*joints, "gripper"]}
    if shape == "v3 nested":
        names = [[*joints, "gripper"]]
    features = {name: {"dtype": "float32", "shape": [4], "names": names} for name in columns}
    if shape == "v3 state with everything":
        entries = [
            *(f"{j}.pos" for j in joints),
            "gripper.pos",
            "gripper.force",
            *(f"{j}.effort" for j in joints),
        ]
        columns = {"observation.state": np.hstack([state, grip, log.tau[:, turn]])}
        features = {"observation.state": {"dtype": "float32", "shape": [8], "names": entries}}
    info = {"codebase_version": shape[:2] + ".0", "fps": 100, "features": features}
    (tmp_path / "meta" / "info.json").write_text(json.dumps(info))
    halves = [slice(0, 300), slice(300, 600)]
    tables = [
        pa.table(
            {
                **{
                    name: pa.array(list(cells[rows].astype(np.float32)), pa.list_(pa.float32()))
                    for name, cells in columns.items()
                },
                "observation.images.top": [{"bytes": b"", "path": "x.png"}] * 300,
                "timestamp": pa.array(log.time[:300], pa.float32()),
                "frame_index": np.arange(300),
                "episode_index": np.full(300, k),
                "next.done": np.zeros(300, dtype=bool),
            }
        )
        for k, rows in enumerate(halves)
    ]
    folder = tmp_path / "data" / "chunk-000"
    if shape == "v2 motors":
        for k, table in enumerate(tables):
            pyarrow.parquet.write_table(table, folder / f"episode_{k:06d}.parquet")
    else:
        pyarrow.parquet.write_table(pa.concat_tables(tables), folder / "file-000.parquet")
    found = convert([tmp_path], arm=three_axis(), answers=Answers("N*m", None, "rad"))
    assert [run.stop - run.start for run in found.log.runs()] == [300, 300]
    np.testing.assert_allclose(found.log.q, log.q, atol=1e-6)
    np.testing.assert_allclose(found.log.tau, log.tau, atol=1e-5)
