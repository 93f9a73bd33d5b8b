"""Which model serves which controller, how stiff it is, what a scenario's reference may be, and what a run is scored by."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from exact_parts import model_of
from numpy.testing import assert_allclose
from pydrake.systems.framework import DiagramBuilder

from armloop.drake.control import bounded_feedforward, controllers
from armloop.drake.control.bounded_feedforward import BoundedReference
from armloop.drake.control.controllers import controller_named
from armloop.drake.experiments import collection, scenario_references, tracking
from armloop.drake.experiments.scenarios import load_tracking
from armloop.experiment.excitation import MotionRanges, TableReference
from armloop.robot.arm import load_arm
from armloop.schemas.scenarios import ReferenceData
from armloop.util.errors import ScenarioError

ARM = load_arm("three_axis")


class TestControllers:
    def test_a_model_of_its_own_name_or_step_comes_first(self) -> None:
        scenario: Any = None
        models: Any = {"model": 0, "step2": 2, "pid_step3": 3, "mine": 4}

        def served(name: str) -> Any:
            return controller_named(name).model(scenario, models, ())

        assert [served(name) for name in ("pid", "pid_step1", "pid_step2", "pid_step3")] == [None, 0, 2, 3]
        assert served("pid_mine") == 4 and served("computed_torque") == 0
        with pytest.raises(
            ValueError, match="no model for the controller pid_yours; the models given are: model, step2"
        ):
            served("pid_yours")
        steps = [
            controller_named(name).step for name in ("pid", "pid_step1", "pid_step2", "pid_step3", "pid_mine")
        ]
        assert steps == [3, 1, 2, 3, 3]

    def test_who_can_run(self) -> None:
        assert controller_named("pid").served_by({})
        step1 = controller_named("pid_step1")
        assert (
            not step1.served_by({"step2": 0})
            and step1.served_by({"step1": 0})
            and step1.served_by({"model": 0})
        )
        assert step1.served_by({"pid_step1": 0})
        names = ("mine", "step1", "pid", "pid_step2")
        assert [controllers.controller_of(name) for name in names] == [
            "pid_mine",
            "pid_step1",
            "pid_pid",
            "pid_step2",
        ]

    def test_as_stiff_as_pid_at_the_start_but_no_faster_than_it_samples(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        class Model:
            pass

        inertia = np.array([[2.0, 0.3], [0.3, 0.5]])
        asked: list[Any] = []
        monkeypatch.setattr(controllers, "ReconstructedModel", Model)
        monkeypatch.setattr(
            controllers,
            "Dynamics",
            lambda model, symmetric: SimpleNamespace(mass_matrix=lambda q: (asked.append(q), inertia)[1]),
        )
        scenario: Any = SimpleNamespace(
            plant=SimpleNamespace(arm=SimpleNamespace(n=2), config=SimpleNamespace(time_step=0.001)),
            bandwidth=None,
            gains=SimpleNamespace(kp=np.array([50.0, 80.0])),
            reference=SimpleNamespace(evaluate=lambda t: (np.array([[0.1, 0.2]]), None, None)),
        )
        model: Any = Model()
        gains = controllers._as_stiff(scenario, model)
        assert_allclose(gains.kp, [25.0, 160.0])
        assert_allclose(gains.kd, [10.0, 2 * np.sqrt(160.0)])
        assert asked[0].tolist() == [0.1, 0.2]
        scenario.plant.config.time_step = 0.01  # 10 rad/s
        assert_allclose(controllers._as_stiff(scenario, model).kp, [25.0, 100.0])
        assert_allclose(controllers._as_stiff(scenario, None).kp, [400.0, 400.0])
        scenario.bandwidth = 3.0
        assert_allclose(controllers._as_stiff(scenario, model).kp, [9.0, 9.0])

    @pytest.mark.parametrize("rate", [None, np.array([30.0, 20.0, 10.0])])
    def test_what_keeps_limits_plans_with_its_share_of_them(
        self, rate: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[Any] = []
        monkeypatch.setattr(bounded_feedforward, "bounded_reference", lambda *of: asked.append(of))
        scenario: Any = SimpleNamespace(
            plant=SimpleNamespace(arm=ARM), reference="reference", used=0.8, rate=rate
        )
        model = model_of(ARM)
        controller_named("bounded").reference(scenario, model)
        ((reference, given, effort, limit),) = asked
        assert reference == "reference" and given is model
        assert_allclose(effort, [0.8 * joint.effort for joint in ARM.joints])
        assert limit is None if rate is None else limit.tolist() == [24.0, 16.0, 8.0]
        other: Any = object()
        with pytest.raises(ValueError, match="bounded needs a reconstructed model"):
            controller_named("bounded").reference(scenario, other)

    def test_torques_that_a_motion_was_planned_with_are_what_is_fed_forward(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        scenario = load_tracking("three_axis_tracking")
        ends = np.array([0.0, scenario.reference.duration])
        still = np.zeros((2, 3))
        torques = np.array([[1.0, 2.0, 3.0], [5.0, 2.0, -1.0]])
        deviation = TableReference(ends, still, still, still)

        class Planned(controllers.Pid):
            name = "planned"

            def reference(self, scenario: Any, model: Any) -> Any:
                return BoundedReference(scenario.reference, deviation, torques)

        monkeypatch.setattr(tracking, "controller_named", lambda name: Planned())
        builder = DiagramBuilder()
        source = tracking.add_controlled_arm(builder, scenario, "planned", {}).reference
        builder.Build()
        context = source.CreateDefaultContext()
        for part in (0.0, 0.25, 1.0):
            context.SetTime(part * ends[1])
            fed = source.GetOutputPort("tau_ff").Eval(context)
            assert_allclose(fed, torques[0] + part * (torques[1] - torques[0]), atol=1e-12)


def test_a_run_is_scored_over_its_interval_in_degrees_and_millimetres() -> None:
    arm = SimpleNamespace(n=2, revolute=np.array([True, False]))
    scenario: Any = SimpleNamespace(
        plant=SimpleNamespace(arm=arm, config=SimpleNamespace(time_step=0.1)), score=(0.2, 0.5)
    )
    time = 0.1 * np.arange(8)
    q_ref, v_ref = np.zeros((10, 2)), np.ones((10, 2))
    state = np.zeros((8, 4))
    state[:, :2], state[:, 2:] = 9.0, 1.0
    state[2:5, 0], state[2:5, 1] = np.deg2rad([1.0, -2.0, 3.0]), [0.001, 0.002, -0.003]
    tau = np.ones((8, 2))
    found = tracking.score(scenario, "pid", time, (q_ref, v_ref, v_ref), state, tau, tau)
    assert found.scored == slice(2, 5) and found.unit == ("deg", "mm")
    assert_allclose(found.eta, [2.0, 2.0])
    assert_allclose(found.rms, [np.sqrt(14 / 3)] * 2)
    assert_allclose(found.largest, [3.0, 3.0])
    assert found.q_ref.shape == found.q.shape == (8, 2) and found.metrics.effort.tolist() == [1.0, 1.0]


class TestReferences:
    RANGES = MotionRanges.of(ARM)

    def of(self, **given: Any) -> Any:
        data = ReferenceData(**given)
        return scenario_references.reference_of(data, ARM, self.RANGES, 1, Path("mine.yaml"), "mine")

    def test_a_reference_keeps_the_joints_limits(self, monkeypatch: pytest.MonkeyPatch) -> None:
        lower, upper = ARM.joints[1].lower, ARM.joints[1].upper
        for low, high, says in (
            (lower, upper, ""),
            (lower - 0.1, upper, "from"),
            (lower, upper + 0.1, "from"),
        ):
            q = np.zeros((3, 3))
            q[1, 1], q[2, 1] = low, high
            reference = SimpleNamespace(duration=0.02, evaluate=lambda t, q=q: (q, q, q))
            monkeypatch.setattr(scenario_references, "fourier_reference", lambda *_, r=reference: r)
            if says:
                with pytest.raises(ScenarioError, match="mine: reference: joint 2 would go from"):
                    self.of(kind="fourier")
            else:
                assert self.of(kind="fourier") is reference

    def test_limits_are_looked_at_every_hundredth_of_a_second_from_the_start(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[Any] = []

        def evaluate(t: Any) -> Any:
            asked.append(t)
            return np.zeros((3, 3)), None, None

        reference = SimpleNamespace(duration=0.1, evaluate=evaluate)
        monkeypatch.setattr(scenario_references, "fourier_reference", lambda *_: reference)
        assert self.of(kind="fourier") is reference
        assert_allclose(asked, [0.01 * np.arange(10)])

    @pytest.mark.parametrize("kind", ["places", "csv"])
    def test_it_lasts_ten_minutes_at_most(self, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
        q = np.zeros((1, 3))
        for seconds in (600.0, 601.0):
            reference = SimpleNamespace(duration=seconds, evaluate=lambda t: (q, q, q))
            for name in ("places_reference", "read_reference"):
                monkeypatch.setattr(scenario_references, name, lambda *_, r=reference, **__: r)
            given: dict[str, Any] = {"kind": kind, "places": [[0.0] * 3] * 2, "file": "motion.csv"}
            if seconds <= 600:
                assert self.of(**given) is reference
            else:
                with pytest.raises(ScenarioError, match=r"601 s; (it must be|they may take)"):
                    self.of(**given)

    def test_places_are_two_or_more_for_all_joints(self) -> None:
        for places in ([], [[0.0] * 3], [[0.0] * 3, [0.0] * 2]):
            with pytest.raises(ScenarioError, match="two or more places of 3 numbers each"):
                self.of(kind="places", places=places)
        with pytest.raises(ScenarioError, match=r"reference\.file is missing"):
            self.of(kind="csv")
        with pytest.raises(ScenarioError, match=r"reference\.kind is 'dance'"):
            self.of(kind="dance")


def test_the_parts_of_a_collection() -> None:
    plan = collection.CollectionPlan(static_poses=3, velocity_segments=2, trajectories=2)
    config: Any = SimpleNamespace(ranges=MotionRanges.of(ARM), time_step=0.002)
    static, constant, varying = collection._parts(ARM, config, plan, 7)
    assert [part.name for part in (static, constant, varying)] == ["static", "constant_velocity", "varying"]
    assert [part.settle for part in (static, constant, varying)] == [0.09, 0.08, 0.0]
    assert [part.time_step for part in (static, constant, varying)] == [plan.segment_time_step] * 2 + [0.002]
    assert static.references[0].duration == pytest.approx(0.44)
    assert constant.references[0].duration == pytest.approx(0.48)
    assert [each.duration for each in varying.references] == [20.0, 20.0]
    one, two = (each.evaluate([1.0])[0] for each in varying.references)
    assert not np.allclose(one, two)
    again = collection._parts(ARM, config, plan, 7)[2].references[1].evaluate([1.0])[0]
    assert np.array_equal(again, two)
    # it creeps through each pose, or stands there
    assert_allclose(np.abs(static.references[0].evaluate([0.2])[1]), np.deg2rad(0.1))
    dwelling = collection._parts(ARM, config, msgspec.structs.replace(plan, dwell=True), 7)[0].references[0]
    assert not dwelling.evaluate([0.2])[1].any()
