"""Collected data against the plant's own mechanics and friction: settled, sliding, as noisy as stated."""

import dataclasses
import warnings

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.data.log import MotionLog, read_log, write_log
from armloop.drake.experiments import collection
from armloop.drake.experiments.collection import collect, measure_run
from armloop.drake.experiments.recording import Recording, as_log
from armloop.drake.experiments.scenarios import load_plan, load_plant, plant_for
from armloop.drake.plant.config import Instruments
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.plant.friction import JointFriction
from armloop.experiment.design import Limits, Series, nominal_torque
from armloop.experiment.excitation import fourier_reference
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.errors import InputWarning, LogError
from armloop.util.progress import silent
from armloop.util.resources import urdf_path
from armloop.workflows import collect_logs

TINY = msgspec.structs.replace(
    load_plan("quick"), static_poses=4, velocity_segments=8, trajectories=1, trajectory_duration=5.0
)
IDEAL = Instruments(encoder_counts=0, torque_noise=0.0)


def tiny(name, **changes):
    plant = load_plant(name)
    config = dataclasses.replace(plant.config, **changes)
    return plant, config, collect(plant.arm, config, TINY, seed=3)


def law(plant, q, v, vdot):
    tau = regressor(plant.arm, q, v, vdot) @ nominal_parameters(plant.arm)
    return tau + np.stack([f.force(v[:, j]) for j, f in enumerate(plant.config.friction)], axis=1)


def test_rotors_are_in_what_is_collected_and_measured():
    plant = load_plant("three_axis")
    rotors = np.array([1.0, 0.8, 0.6])
    config = dataclasses.replace(plant.config, instruments=IDEAL, rotor_inertia=tuple(rotors))
    run = measure_run(plant.arm, config, 1, duration=5.0)
    varying = collect(plant.arm, config, TINY, seed=3)["varying"]
    for log in (run, varying):
        for rows in log.runs():
            part = log.select(rows)
            vdot = np.gradient(part.v, part.time, axis=0)
            more = part.tau - law(plant, part.q, part.v, vdot)
            slides = (np.abs(part.v) > 0.1).all(axis=1)
            found = [np.polyfit(vdot[slides, j], more[slides, j], 1)[0] for j in range(3)]
            assert_allclose(found, rotors, rtol=0.05)


@pytest.mark.parametrize("name", ["three_axis", "scara"])
def test_settled_segments_hold_the_law(name):
    plant, _, logs = tiny(name, instruments=IDEAL)
    for condition, runs in (("static", 8), ("constant_velocity", 8)):
        log = logs[condition]
        assert len(log.runs()) == runs
        for rows in log.runs():
            # Really at constant speed: no stick-slip at 0.1 deg/s, no transient left.
            part = log.select(rows)
            assert_allclose(part.v, np.tile(part.v.mean(axis=0), (len(part.v), 1)), rtol=0.03, atol=2e-7)
            assert np.all(np.abs(part.v) > 5e-5)
            expected = law(plant, part.q, part.v, 0 * part.v)
            assert_allclose(part.tau, expected, atol=2e-3 * np.abs(expected).max() + 1e-3)
    creep = np.abs(logs["static"].v)
    nominal = np.where(plant.arm.revolute, np.deg2rad(0.1), 1e-4)
    assert_allclose(creep, np.tile(nominal, (len(creep), 1)), rtol=0.03)


def test_varying_part_holds_the_law_while_sliding():
    plant, _, logs = tiny("three_axis", instruments=IDEAL)
    log = logs["varying"]
    vdot = np.gradient(log.v, log.time, axis=0)
    sliding = np.all(np.abs(log.v) > 0.05, axis=1)
    sliding[:2] = sliding[-2:] = False
    difference = (log.tau - law(plant, log.q, log.v, vdot))[sliding]
    assert np.sqrt((difference**2).mean(axis=0)).max() < 0.02


def test_instruments_add_what_they_say():
    _, _, real = tiny("three_axis")
    _, _, ideal = tiny("three_axis", instruments=IDEAL)
    for condition in real:
        count = 2 * np.pi / 2**19
        assert_allclose(np.round(real[condition].q / count) * count, real[condition].q, atol=1e-8)
        assert np.abs(real[condition].q - ideal[condition].q).max() < 0.6 * count
        noise = real[condition].tau - ideal[condition].tau
        rms = np.sqrt((ideal[condition].tau ** 2).mean(axis=0))
        assert_allclose(noise.std(axis=0), 0.01 * rms, rtol=0.2)


def test_collection_is_repeatable_tells_its_progress_and_can_be_written(tmp_path):
    plant = load_plant("three_axis")
    plan = msgspec.structs.replace(TINY, static_poses=1, velocity_segments=2, trajectories=0)
    seen = []
    logs = collect(plant.arm, plant.config, plan, 1, lambda what, done: seen.append((what, done)))
    assert [what for what, _ in seen] == ["constant_velocity"] * 2 + ["static"] * 2
    done = [part for _, part in seen]
    assert done == sorted(done) and done[-1] == pytest.approx(1.0)
    again = collect(plant.arm, plant.config, plan, 1, processes=2)
    assert np.array_equal(logs["static"].tau, again["static"].tau)
    assert not np.array_equal(logs["static"].tau, collect(plant.arm, plant.config, plan, 2)["static"].tau)
    write_log(tmp_path / "static.csv", logs["static"])
    assert np.array_equal(read_log(tmp_path / "static.csv").q, logs["static"].q)


def test_dwelling_hides_friction():
    plant = load_plant("three_axis")
    plan = msgspec.structs.replace(TINY, dwell=True, velocity_segments=0, trajectories=0)
    logs = collect(plant.arm, plant.config, plan, 1)
    assert list(logs) == ["static"]
    assert len(logs["static"].runs()) == 4
    assert np.abs(logs["static"].v).max() < 2e-3  # one encoder count over the window


def test_measured_run_carries_the_effect_and_does_not_name_it():
    plant = load_plant("three_axis")
    clean, loaded = (
        measure_run(plant.arm, plant.config, 5, duration=5.0, effects=effects)
        for effects in ((), (UndeclaredEffect("torque_offset", 2, {"offset": 0.7}),))
    )
    assert clean.name == loaded.name
    assert len(clean.runs()) == 1
    assert 1 / clean.period == pytest.approx(500.0)
    assert (loaded.tau - clean.tau).mean(axis=0) == pytest.approx([0.0, 0.7, 0.0], abs=0.01)


def test_any_urdf_has_a_plant(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(
        """<robot name="two"><link name="base"/>
        <link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <link name="b"><inertial><mass value="0.5"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="turn" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
        <joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
        <limit lower="0" upper="0.3" velocity="0.5" effort="60"/></joint></robot>"""
    )
    plant = plant_for(path)
    logs = collect(plant.arm, plant.config, TINY, 0)
    for rows in logs["static"].runs():
        part = logs["static"].select(rows)
        expected = law(
            plant, part.q, np.sign(part.v.mean(axis=0)) * [np.deg2rad(0.1), 1e-4] + 0 * part.v, 0 * part.v
        )
        assert_allclose(part.tau.mean(axis=0), expected.mean(axis=0), rtol=0.02, atol=0.03)


def test_friction_that_nobody_stated_is_said_and_what_is_not_used(tmp_path):
    path, text = tmp_path / "own.urdf", urdf_path("three_axis").read_text()
    for dynamics, names in (
        ('<dynamics damping="0.0" friction="0.0"/>', None),
        ('<dynamics damping="0.0" friction="0.7"/>', "joint_1, joint_2, joint_3"),
        ('<dynamics damping="0.4"/>', "joint_1, joint_2, joint_3"),
    ):
        path.write_text(text.replace("</joint>", f"{dynamics}</joint>"))
        for arm in (path, load_arm(path)):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                friction = plant_for(arm).config.friction
            assert friction == (JointFriction(0.65, 0.5, 0.1, 1.0),) * 3
            said = [str(one.message) for one in caught if issubclass(one.category, InputWarning)]
            assert len(said) == 1
            assert "friction of a usual size, Coulomb 0.5, 0.5, 0.5 N·m" in said[0]
            assert ("not used" in said[0]) == (names is not None)
            assert names is None or f"<dynamics> of {names} are not used" in said[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        own = (JointFriction(1.0, 1.0),) * 3
        assert plant_for(path, own).config.friction == own
        collect_logs(path, "simulation", 0, silent)  # of inverse dynamics without friction: nothing to say


def test_a_motion_of_the_designed_family_is_followed():
    """What `armloop excite` chooses from: fitted into all limits, from rest to rest."""
    plant = load_plant("scara")
    series = Series(4, 6, 6.0)
    effort = np.array([joint.effort for joint in plant.arm.joints])
    draft = series.reference(np.random.default_rng(3).normal(size=(4, series.free)))
    made = Limits(plant.config.ranges, 0.8 * effort, nominal_torque(plant.arm)).fitted(draft, 1e-3)
    log = measure_run(plant.arm, plant.config, 1, reference=made)
    q, v, _ = made.evaluate(log.time)
    assert log.time[-1] > 5.99
    assert np.all(np.abs(v).max(axis=0) > 0.3 * plant.config.ranges.velocity)
    assert np.abs(log.q - q).max() < 2e-4
    assert np.sqrt(np.mean((log.v - v) ** 2, axis=0)).max() < 5e-3
    assert np.all(np.abs(log.tau).max(axis=0) < effort)


class TestPieces:
    """A rig that records one sample per 0.1 s of zeros, and of the torque one."""

    @pytest.fixture
    def rigs(self, monkeypatch):
        made = []

        class Rig:
            def __init__(self, arm, friction, *, time_step, **of):
                self.time_step, self.of, self.followed = time_step, of, []
                made.append(self)

            def follow(self, reference, *, rate, settle=0.0):
                self.followed.append((reference.duration, rate, settle))
                time = np.arange(0.0, max(reference.duration, 0.3), 0.1)
                q = np.full((len(time), 3), reference.duration)
                return Recording(time, q, 0 * q, 1 + 0 * q)

        monkeypatch.setattr(collection, "SpeedModeArm", Rig)
        return made

    def test_the_longest_segments_come_first_and_each_time_step_has_one_rig(self, rigs):
        plant = load_plant("three_axis")
        plan = msgspec.structs.replace(
            TINY, static_poses=1, velocity_segments=2, trajectories=2, trajectory_duration=5.0, rate=7.0
        )
        told = []
        logs = collect(plant.arm, plant.config, plan, 1, lambda what, done: told.append((what, done)))
        fine, coarse = rigs
        assert fine.time_step == plant.config.time_step and coarse.time_step == plan.segment_time_step
        assert fine.followed == [(5.0, 7.0, 0.0)] * 2
        constant = plan.velocity_settle + plan.velocity_hold, 7.0, plan.velocity_settle
        static = plan.static_settle + plan.static_hold, 7.0, plan.static_settle
        assert coarse.followed == [constant] * 2 + [static] * 2
        total = 10 + 2 * constant[0] + 2 * static[0]
        done = np.cumsum([5.0, 5.0, constant[0], constant[0], static[0], static[0]]) / total
        assert_allclose([part for _, part in told], done)
        assert list(logs) == ["static", "constant_velocity", "varying"]
        assert [len(log.runs()) for log in logs.values()] == [2, 2, 2]

    def test_trajectories_differ_by_seed_and_number(self):
        plant = load_plant("three_axis")
        plan = msgspec.structs.replace(TINY, static_poses=1, velocity_segments=2, trajectories=2)
        parts = {part.name: part for part in collection._parts(plant.arm, plant.config, plan, 3)}
        for k, reference in enumerate(parts["varying"].references):
            expected = fourier_reference(plant.config.ranges, plan.trajectory_duration, 3000 + k)
            assert_allclose(reference.evaluate([0.7])[0], expected.evaluate([0.7])[0])
        assert (parts["varying"].settle, parts["static"].settle) == (0.0, plan.static_settle)
        creep = np.abs(parts["static"].references[0].evaluate([0.1])[1][0])
        assert_allclose(creep, np.deg2rad(0.1))
        dwelling = collection._parts(plant.arm, plant.config, msgspec.structs.replace(plan, dwell=True), 3)[0]
        assert len(dwelling.references) == 1 and not dwelling.references[0].evaluate([0.1])[1].any()

    def test_a_measured_run_is_of_fifty_seconds_and_five_harmonics_at_half_a_kilohertz(
        self, rigs, monkeypatch
    ):
        asked = []

        def drawn(ranges, duration, seed, harmonics):
            asked.append((duration, seed, harmonics))
            return fourier_reference(ranges, 1.0, seed, harmonics=harmonics)

        monkeypatch.setattr(collection, "fourier_reference", drawn)
        plant, told = load_plant("three_axis"), []
        measure_run(plant.arm, plant.config, 4, progress=lambda what, done: told.append(done))
        assert asked == [(50.0, 4, 5)] and rigs[0].followed == [(1.0, 500.0, 0.0)] and told == [0.0, 1.0]

    def test_recordings_are_runs_twenty_periods_apart_with_the_sensors_noise(self):
        time = np.arange(5) * 0.01
        q = np.linspace(0.0, 1e-3, 5)[:, None] + 1.23456789123e-3
        parts = [Recording(time, q, q, 3.0 + 0 * q), Recording(time + 0.5, q, q, 4.0 + 0 * q)]
        log = as_log("two", parts, Instruments(torque_noise=0.02), np.random.default_rng(8))
        assert_allclose(log.time, [*time, *(0.04 + 0.2 + 0.5 + time)], atol=1e-9)
        assert len(log.runs()) == 2 and log.name == "two"
        noise = 0.02 * np.sqrt(12.5) * np.random.default_rng(8).standard_normal((10, 1))
        tau = np.repeat([3.0, 4.0], 5)[:, None] + noise
        assert np.array_equal(log.tau, np.round(tau, 6))
        assert np.array_equal(log.q[:5], np.round(q, 9)) and np.array_equal(log.v[:5], np.round(q, 7))

    def test_what_an_unstable_loop_did_is_recorded_though_nobody_would_believe_the_measurement(self):
        time = np.arange(200) * 0.01
        q = np.sin(time)[:, None]
        tau = np.cos(time)[:, None]
        tau[100] = -95.0
        with pytest.raises(LogError, match="spike"):
            MotionLog(time, q, np.cos(time)[:, None], tau)
        run = Recording(time, q, np.cos(time)[:, None], tau)
        log = as_log("run", [run], Instruments(torque_noise=0.0), np.random.default_rng(1))
        assert log.tau[100, 0] == -95.0 and log.samples == 200 and log.v_derived is False
