"""LeRobot data sets whose names or rows do not fit: no row slips, and no joint is paired with another's torque."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from foreign_logs import assert_same, motion

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


def test_an_effort_of_no_position_asks_for_a_map(tmp_path, log):
    names = {"state": JOINTS, "velocity": JOINTS, "effort": ["shoulder", "elbow", "lift"]}
    folder = data_set(tmp_path / "set", log, names)
    with pytest.raises(InputError, match=r"observation.effort/lift belong to no position by name, .*--map"):
        convert([folder], answers=ASKED)
    columns = {kind: [f"observation.{kind}/{name}" for name in entries] for kind, entries in names.items()}
    mapping = Mapping(
        TimeMap("timestamp", "s"),
        QuantityMap(columns["state"], "rad"),
        QuantityMap(columns["effort"], "N*m"),
        QuantityMap(columns["velocity"], "rad/s"),
    )
    assert_same(convert([folder], mapping=mapping).log, log)


def test_velocities_of_other_joints_are_not_taken(tmp_path, log):
    names = {"state": JOINTS, "effort": JOINTS, "velocity": ["elbow", "waist", "lift"]}
    found = convert([data_set(tmp_path / "set", log, names)], answers=ASKED)
    assert any("central differences" in note for note in found.notes)
    np.testing.assert_allclose(found.log.v, log.v, atol=0.05)
