"""Bags whose messages differ: in their joints, their stamps, their turn; nothing is taken for the arm without being said."""

from collections.abc import Iterable
from pathlib import Path

import pytest
from foreign_logs import NAMES, assert_same, bag, motion
from synthetic import three_axis

from armloop.convert import Answers, convert
from armloop.data.log import MotionLog, unchecked_log
from armloop.util.errors import InputError

TORQUE = Answers(tau_unit="N*m")
BEGIN = 1_700_000_000 * 10**9


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return motion()


def stamped(folder: Path, log: MotionLog, stamps: Iterable[int]) -> Path:
    """A bag whose messages are recorded at the log's times, with stamps of their own, ns."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    clock = store.types["builtin_interfaces/msg/Time"]
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for k, ns in enumerate(stamps):
            stamp = clock(sec=int(ns) // 10**9, nanosec=int(ns) % 10**9)
            message = state(
                header=header(stamp=stamp, frame_id=""),
                name=NAMES,
                position=log.q[k],
                velocity=log.v[k],
                effort=log.tau[k],
            )
            raw = store.serialize_cdr(message, "sensor_msgs/msg/JointState")
            writer.write(topic, BEGIN + round(log.time[k] * 1e9), raw)
    return folder


def test_whose_joints_are_the_arms_is_asked_where_messages_differ(tmp_path, log):
    path = bag(tmp_path / "bag", log, [0, 1, 2], kind="mcap", gripper=True)
    with pytest.raises(
        InputError,
        match=r"some messages name the joints joint_1, joint_2, joint_3, others finger; give --arm",
    ):
        convert([path], answers=TORQUE)
    notes = convert([path], arm=three_axis(), answers=TORQUE).notes
    assert f"messages without all joints of the arm, left out: {log.samples}" in notes
    assert "joints that are not the arm's, left out: finger" in notes


def test_another_order_of_the_same_joints_is_no_other_arm(tmp_path, log):
    path = bag(tmp_path / "bag", log, [2, 1, 0], kind="mcap", shuffle=True)
    assert_same(convert([path], answers=TORQUE).log, log)


@pytest.mark.parametrize("back", [0.05, 1.0, 3600.0])
def test_a_clock_that_was_set_back_begins_a_run(tmp_path, log, back):
    stamps = [BEGIN + round((at - back * (k >= 300)) * 1e9) for k, at in enumerate(log.time)]
    found = convert([stamped(tmp_path / "bag", log, stamps)], arm=three_axis(), answers=TORQUE)
    assert_same(found.log, log)
    assert found.log.runs() == [slice(0, 300), slice(300, 600)]
    assert any("message 301: the clock of the stamps was set back by" in note for note in found.notes)


def test_late_messages_are_sorted(tmp_path, log):
    turn = sorted(range(log.samples), key=lambda k: k + 3.5 * (k % 50 == 0))
    late = unchecked_log(time=log.time, q=log.q[turn], v=log.v[turn], tau=log.tau[turn])
    path = stamped(tmp_path / "bag", late, [BEGIN + round(at * 1e9) for at in log.time[turn]])
    found = convert([path], arm=three_axis(), answers=TORQUE)
    assert_same(found.log, log)
    assert "12 messages were recorded out of turn; they are sorted by their stamps" in found.notes


def test_messages_without_a_stamp_are_left_out(tmp_path, log):
    stamps = [0 if k < 2 else BEGIN + round(at * 1e9) for k, at in enumerate(log.time)]
    found = convert([stamped(tmp_path / "bag", log, stamps)], arm=three_axis(), answers=TORQUE)
    assert_same(found.log, log.select(slice(2, None)))
    assert len(found.log.runs()) == 1 and "messages without a stamp, left out: 2" in found.notes
