"""The live view is for this computer alone, and changes nothing of what it shows."""

import dataclasses
import logging
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from armloop.cli import main
from armloop.drake.experiments.pickup import run_pickup
from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.experiments.tracking import run_tracking, track_in_view
from armloop.drake.plant.plant import add_links
from armloop.drake.view import live, scene
from armloop.drake.view.live import LiveView
from armloop.robot.arm import load_arm


@pytest.fixture(scope="module")
def brief():
    scenario = load_tracking("scara_pick_and_place:exact")
    reference = dataclasses.replace(scenario.reference)
    reference = _Beginning(reference, 0.6)
    return dataclasses.replace(scenario, reference=reference, score=(0.1, 0.6))


class _Beginning:
    """The first seconds of a reference."""

    def __init__(self, whole, duration):
        self._whole, self.duration = whole, duration

    def evaluate(self, t):
        return self._whole.evaluate(t)


def listening(port: int) -> set[str]:
    """The addresses on which any process listens at a port, as the kernel writes them."""
    found = set()
    for table in (Path("/proc/net/tcp"), Path("/proc/net/tcp6")):
        if not table.is_file():
            pytest.skip("the kernel's list of sockets is needed")
        for line in table.read_text().splitlines()[1:]:
            local, state = line.split()[1], line.split()[3]
            address, number = local.rsplit(":", 1)
            if state == "0A" and int(number, 16) == port:
                found.add(address)
    return found


def test_the_server_listens_on_the_loopback_address_only(brief, caplog):
    caplog.set_level(logging.INFO)
    view = LiveView(brief.plant.arm, 0.0)
    assert view.address.startswith("http://127.0.0.1:")
    assert not caplog.records
    assert listening(int(view.address.rsplit(":", 1)[1])) == {"0100007F"}
    with urllib.request.urlopen(view.address, timeout=10) as page:
        assert b"<script" in page.read()
    assert not view.wait(5.0)  # nobody looks, and at rate 0 nobody is waited for


class Clock:
    """Time that goes on when somebody sleeps, and a page that somebody opens at a moment."""

    def __init__(self, opened):
        self.now, self.opened = 100.0, 100.0 + opened

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds

    def GetNumActiveConnections(self):
        return int(self.now >= self.opened)


@pytest.mark.parametrize(
    ("rate", "opened", "seen", "after"),
    [(1.0, 0.0, True, 0.0), (1.0, 0.45, True, 0.5), (0.5, 1.05, False, 1.0), (0.0, 0.5, False, 0.0)],
)
def test_a_browser_is_waited_for_as_long_as_is_said(brief, rate, opened, seen, after, monkeypatch):
    view, clock = LiveView(brief.plant.arm, rate), Clock(opened)
    monkeypatch.setattr(view, "_meshcat", clock)
    monkeypatch.setattr(live, "time", clock)
    assert view.wait(0.95) == seen
    assert clock.now - 100.0 == pytest.approx(after)


def test_what_is_shown_moves_as_without(brief):
    shown = track_in_view(brief, {}, LiveView(brief.plant.arm, 0.0))
    alone = run_tracking(brief, {}, processes=1)
    assert list(shown) == list(alone) == ["pid", "exact"]
    for name in alone:
        assert np.array_equal(shown[name].q, alone[name].q)
        assert_allclose(shown[name].eta, alone[name].eta, rtol=1e-12)


def test_each_arm_stands_where_its_system_says_and_its_ghost_on_the_reference():
    """Two arms of three joints, whose six positions and twelve states are all different."""
    arm = load_arm("three_axis")
    view, builder = LiveView(arm, 0.0), DiagramBuilder()
    numbers = np.arange(1, 19) / 10
    shown = {}
    for k, name in enumerate(("pid", "mine")):
        inner = DiagramBuilder()
        for port, values in (
            ("state", numbers[9 * k : 9 * k + 6]),
            ("q_ref", numbers[9 * k + 6 : 9 * k + 9]),
        ):
            inner.ExportOutput(inner.AddSystem(ConstantVectorSource(values)).get_output_port(), port)
        shown[name] = builder.AddNamedSystem(name, inner.Build())
    view.add_to(builder, shown)
    diagram = builder.Build()
    (scene_graph,) = (s for s in diagram.GetSystems() if isinstance(s, SceneGraph))
    context = scene_graph.GetMyContextFromRoot(diagram.CreateDefaultContext())
    query = scene_graph.get_query_output_port().Eval(context)
    plant = MultibodyPlant(0.0)
    add_links(plant, arm)
    plant.Finalize()
    own = plant.CreateDefaultContext()
    for k, name in enumerate(("pid", "mine")):
        for label, q in (
            (name, numbers[9 * k : 9 * k + 3]),
            (f"{name}_reference", numbers[9 * k + 6 : 9 * k + 9]),
        ):
            plant.SetPositions(own, q)
            instance = view._plant.GetModelInstanceByName(label)
            last = view._plant.GetBodyByName("link_3", instance)
            frame = view._plant.GetBodyFrameIdOrThrow(last.index())
            expected = plant.EvalBodyPoseInWorld(own, plant.GetBodyByName("link_3"))
            X = query.GetPoseInWorld(frame)
            side = X.translation() - expected.translation()
            assert_allclose(X.rotation().matrix(), expected.rotation().matrix(), atol=1e-12)
            assert_allclose(side[[0, 2]], 0.0, atol=1e-12)
            assert side[1] == pytest.approx((0.5 - k) * 1.2 * scene._reach(arm))


def test_it_keeps_to_its_rate(brief):
    view = LiveView(brief.plant.arm, 0.5)
    began = time.monotonic()
    track_in_view(dataclasses.replace(brief, controllers=("pid",)), {}, view)
    assert time.monotonic() - began > 0.95 * 0.6 / 0.5
    with pytest.raises(ValueError, match="rate is -1"):
        LiveView(brief.plant.arm, -1)


def test_a_pickup_is_shown_with_and_without_its_load():
    scenario = load_tracking("payload_pickup")
    pickup = dataclasses.replace(scenario.pickup, at=0.2, diagnose_at=1.0)
    reference = _Beginning(scenario.reference, 1.2)
    scenario = dataclasses.replace(scenario, pickup=pickup, reference=reference, score=(0.0, 1.2))

    class Nothing:
        def feedforward(self, q, v, vdot, step):
            return np.zeros(3)

    view = LiveView(scenario.plant.arm, 0.0)
    shown, alone = (run_pickup(scenario, Nothing(), lambda log: Nothing(), v) for v in (view, None))
    assert np.array_equal(shown.phases["augmented"].q, alone.phases["augmented"].q)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("friction_wear --meshcat", "--meshcat: friction_wear runs many times at once"),
        ("three_axis_tracking --meshcat --rate -2", "--rate -2: it must be a number of at least 0"),
        ("three_axis_tracking --rate 2", "--rate is the pace of --meshcat"),
    ],
)
def test_what_cannot_be_shown_is_one_line(words, message, capsys):
    assert main(["track", *words.split()]) == 2
    error = capsys.readouterr().err
    assert error.startswith("armloop: ") and message in error and error.count("\n") == 1
