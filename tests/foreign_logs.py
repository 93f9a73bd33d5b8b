"""Writers of other programs' logs, each as the program writes it, from one motion; and what is asked of the reader."""

from pathlib import Path

import numpy as np
from synthetic import fourier_motion, friction, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog

NAMES = [joint.name for joint in three_axis().joints]


def motion(seconds: float = 6.0, rate: float = 100.0) -> MotionLog:
    m = fourier_motion(seconds, rate, 1)
    tau = rigid_torque(three_axis(), m.q, m.v, m.vdot) + friction(m.v)
    return MotionLog(m.time, m.q, m.v, tau, name="run")


def bag(
    folder: Path, log: MotionLog, order: list[int], *, kind: str, names: list[str] | None = None, **how
) -> Path:
    """A ROS 2 bag of joint states; see the arguments at `_messages`."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    plugin = {"db3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[kind]
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for topic, at, message in _messages(store, log, order, names or NAMES, **how):
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, "sensor_msgs/msg/JointState", typestore=store
                )
            raw = store.serialize_cdr(message, "sensor_msgs/msg/JointState")
            writer.write(connections[topic], at, raw)
    return next(folder.glob(f"*.{kind}"))


def _messages(
    store,
    log,
    order,
    names,
    *,
    stamps=True,
    gripper=False,
    topics=("/joint_states",),
    shuffle=False,
    velocity=True,
    effort=True,
):
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    clock = store.types["builtin_interfaces/msg/Time"]
    begin = 1_700_000_000
    for k in range(log.samples):
        ns = begin * 10**9 + round(log.time[k] * 1e9)
        stamp = clock(sec=ns // 10**9, nanosec=ns % 10**9) if stamps else clock(sec=0, nanosec=0)
        turn = order if not shuffle or k % 2 else order[::-1]
        for topic in topics:
            yield (
                topic,
                ns + 1_000_000,
                state(
                    header=header(stamp=stamp, frame_id=""),
                    name=[names[j] for j in turn],
                    position=log.q[k, turn],
                    velocity=log.v[k, turn] if velocity else np.empty(0),
                    effort=log.tau[k, turn] if effort else np.empty(0),
                ),
            )
        if gripper:
            one = np.array([0.01])
            yield (
                topics[0],
                ns + 2_000_000,
                state(
                    header=header(stamp=stamp, frame_id=""),
                    name=["finger"],
                    position=one,
                    velocity=one,
                    effort=one,
                ),
            )


def rtde(path: Path, log: MotionLog, separator: str = " ") -> Path:
    """What `record.py` of the RTDE client writes, with the joints' temperatures."""
    n = log.joints
    stems = ("actual_q", "actual_qd", "actual_current", "joint_temperatures")
    names = ["timestamp", *(f"{stem}_{j}" for stem in stems for j in range(n))]
    warm = 30.0 + np.outer(log.time, np.arange(1, n + 1))
    rows = np.column_stack([1000.0 + log.time, log.q, log.v, log.tau / 10.0, warm])
    lines = [separator.join(f"{x:.9g}" for x in row) for row in rows]
    path.write_text("\n".join([separator.join(names), *lines]) + "\n")
    return path


def libfranka(path: Path, log: MotionLog, *, old: bool, parts: int) -> Path:
    """Logs of several control exceptions below each other, each with its header; times in ms from zero."""
    n, text = log.joints, []
    prefix = "" if old else "state."

    def named(stem: str) -> str:
        return (", " if old else ",").join(f"{stem}[{j}]" for j in range(n))

    fields = [named(prefix + stem) for stem in ("q", "q_d", "dq", "dq_d", "tau_J", "tau_ext_hat_filtered")]
    first = "duration, success rate" if old else "time,success_rate"
    # The old version names one more column than it fills between state and command: "sent commands".
    command = ["sent commands", named("q_d")] if old else [named("cmd.q_d")]
    for part in np.array_split(np.arange(log.samples), parts):
        text.append(",".join([first + (" " if old else ""), *fields, *command]))
        for k in part:
            ms = round(1e3 * (log.time[k] - log.time[part[0]]))
            state = [log.q[k], log.q[k], log.v[k], log.v[k], log.tau[k], 0 * log.tau[k]]
            cells = ",".join(f"{x:.9g}" for values in state for x in values)
            text.append(f"{ms},1,{cells}" + (",," if old else ",") + ",".join(f"{x:.9g}" for x in log.q[k]))
    path.write_text("\n".join(text) + "\n")
    return path


def assert_same(found: MotionLog, log: MotionLog, tolerance: float = 1e-8) -> None:
    assert found.samples == log.samples
    np.testing.assert_allclose(found.q, log.q, atol=tolerance * 10)
    np.testing.assert_allclose(found.v, log.v, atol=tolerance * 10)
    np.testing.assert_allclose(found.tau, log.tau, atol=tolerance * 100)


def refused(line: list[str], capsys) -> str:
    """The line that a command refuses its input with."""
    assert main(line) == 2
    error = capsys.readouterr().err
    assert error.startswith("armloop: ") and error.count("\n") == 1
    return error
