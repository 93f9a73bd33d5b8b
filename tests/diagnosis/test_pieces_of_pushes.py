"""The size, interval and trial of a push, on numbers small enough to see through."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exact_parts import six_joints
from synthetic import fourier_motion, three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import pushes
from armloop.diagnosis.event_size import event_size, event_size_error
from armloop.laws.effects import Context, Estimate, effect
from armloop.model import AddedEffect
from armloop.robot.kinematics import tool_jacobian


def motion(lengths: tuple[int, ...], joints: int = 1) -> Motion:
    """Runs of so many samples, 0.01 s each, at rest, 5 s apart."""
    N, starts = sum(lengths), np.cumsum([0, *lengths[:-1]])
    time = np.arange(N) * 0.01 + 5.0 * (np.searchsorted(starts, np.arange(N), side="right") - 1)
    return Motion(time, *np.zeros((3, N, joints)), starts)


class TestSizeOfAPush:
    def test_a_direction_that_is_hardly_felt_tells_nothing(self) -> None:
        for felt, size in ((0.031, 2.0), (0.029, 0.0)):
            columns = np.array([[[1.0, 0.0]], [[0.0, felt]]])
            y = np.array([[3.0], [2.0 * felt]])
            np.testing.assert_allclose(event_size(columns, y), [3.0, size])

    def test_its_error_counts_pieces_and_what_is_not_felt_may_be_as_large_as_what_is(self) -> None:
        columns = np.zeros((4, 1, 2))
        columns[:, 0, 0] = 1.0
        left, pieces = np.array([[1.0], [2.0], [3.0], [-1.0]]), np.array([0, 0, 1, 1])
        error = event_size_error(columns, np.array([3.0, 4.0]), left, pieces)
        # scores of the pieces 3 and 2, over four samples
        np.testing.assert_allclose(error, [np.sqrt(13) / 4, 5.0])
        # felt by a hundredth: still felt enough for the error that its square has
        columns[:, 0, 1] = [0.05, -0.05, 0.05, -0.05]
        error = event_size_error(columns, np.array([3.0, 4.0]), 0 * left, pieces)
        np.testing.assert_allclose(error, 0.0, atol=1e-6)
        columns[:, 0, 1] /= 2
        np.testing.assert_allclose(
            event_size_error(columns, np.array([3.0, 4.0]), 0 * left, pieces), [0.0, 5.0], atol=1e-6
        )


class TestWhereAForceActs:
    def at(self, link: float, force: float) -> pushes.Contact:
        of = {"force": Estimate([force, 0.0, 0.0], [0.3, 0.0, 0.0], "N")}
        if link:
            of["link"] = Estimate(link, 0.0, "1")
        nothing: Any = None
        added = AddedEffect(effect("external_contact", None), of)
        return pushes.Contact(added, nothing, nothing, nothing, 0.9, 0.9)

    def test_what_explains_it_elsewhere_is_the_error_of_force_and_link(self) -> None:
        points = [self.at(4.0, 3.0), self.at(4.5, 2.0), self.at(3.5, 4.0)]
        found = pushes._somewhere(self.at(4.0, 3.0), points).added.parameters
        np.testing.assert_allclose(found["force"].std_error, [np.sqrt(0.5 + 0.09), 0.0, 0.0])
        # points half a link apart, and anywhere between them
        np.testing.assert_allclose(found["link"].std_error, np.sqrt(0.5 / 4 + 0.25 / 12))
        assert found["link"].value == 4.0

    def test_no_more_is_known_of_a_link_than_its_points_are_apart(self) -> None:
        found = pushes._somewhere(self.at(4.0, 3.0), []).added.parameters
        np.testing.assert_allclose(found["link"].std_error, 0.5 / np.sqrt(12))

    def test_what_one_joint_alone_shows_may_be_due_to_a_force_on_any_link_from_that_on(self) -> None:
        given = self.at(4.0, 3.0)
        found = pushes._somewhere(given, [], None, 2).added.parameters
        # at 4, or at 2, 2.5, 3 and 3.5
        np.testing.assert_allclose(found["link"].std_error, np.sqrt((4 + 2.25 + 1 + 0.25) / 5 + 0.25 / 12))
        assert found["force"] == pushes._somewhere(given, []).added.parameters["force"]

    @pytest.mark.parametrize(("beyond", "error"), [(1.0, np.sqrt(4.0 + 0.09)), (3.1, np.sqrt(0.5 + 0.09))])
    def test_it_may_be_as_far_off_as_a_point_beyond_them_says(self, beyond: float, error: float) -> None:
        points = [self.at(4.5, 2.0), self.at(3.5, 4.0), self.at(4.0, 3.0)]
        force = np.array([beyond, 0.0, 0.0])
        found = pushes._somewhere(self.at(0.0, 3.0), points, force).added.parameters
        assert found["force"].value == [3.0, 0.0, 0.0]
        np.testing.assert_allclose(found["force"].std_error, [error, 0.0, 0.0])

    @pytest.mark.parametrize("tool", [False, True])
    @pytest.mark.parametrize("seed", [1, 2, 3])
    def test_a_force_beyond_the_last_link_lies_within_its_error(self, seed: int, tool: bool) -> None:
        """Of a gripper that the URDF does not have, or whose fingers are longer than it says."""
        rng = np.random.default_rng(seed)
        arm, away, held = six_joints(), np.eye(4), np.eye(4)
        away[:3, 3], held[0, 3] = rng.uniform(-0.25, 0.25, 3), 0.08 * tool
        # a point is stated in the frame of the tool, which may be turned where it is not moved
        held[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        given = fourier_motion(6.0, 100.0, seed, arm)
        force = rng.normal(size=3) * 10.0
        rows = slice(250, 350)
        residual = 0.02 * rng.normal(size=(600, 6))
        residual[rows] -= force @ tool_jacobian(replace(arm, X_tool=away), given.q[rows])
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=given, period=0.01, reach=0.02),
            scale=np.full(6, 0.02),
            variation=np.ones(6),
            model=SimpleNamespace(arm=replace(arm, X_tool=held)),
        )
        found = pushes.push(evidence, residual, rows, np.ones((600, 6), dtype=bool), list(range(6)))
        assert found is not None and found.added.effect.name == "external_contact"
        stated = found.added.parameters["force"]
        off = np.abs(np.asarray(stated.value) - force)
        assert (off < 3 * np.asarray(stated.std_error)).all()
        # where it acts is sought beyond the last link, if the URDF has no tool there, and stated if that explains more
        assert ("point" in found.added.parameters) == (not tool and seed != 1)
        if "point" not in found.added.parameters:
            assert (off > 0.5).any()
            return
        point = found.added.parameters["point"]
        beside = np.abs(np.asarray(point.value) - held[:3, :3].T @ away[:3, 3])
        assert (beside < 3 * np.asarray(point.std_error)).all() and point.unit == "m"
        # along the force nothing but the motion tells of it
        assert beside.max() < 0.05
        assert np.linalg.norm(off) < 0.05 * np.linalg.norm(force) and found.share > 0.99
        context = Context(evidence.model.arm, given)
        expected = np.zeros((600, 6))
        expected[rows] = residual[rows]
        left = found.added.torque(context) - expected
        assert (left**2).sum() < (1 - 0.99) * (expected**2).sum()

    def test_along_a_force_nothing_tells_where_it_acts_but_how_long_things_usually_are(self) -> None:
        """Of an arm that keeps its posture: half of its longest link is the standard deviation of the point there."""
        arm, away, force = six_joints(), np.eye(4), np.array([0.0, 0.0, 9.0])
        given = motion((200,), 6)
        given.q[:] = [0.3, -0.7, 0.9, 0.4, 0.8, -0.2]
        rng = np.random.default_rng(4)
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=given, period=0.01, reach=0.0),
            scale=np.ones(6),
            model=SimpleNamespace(arm=arm),
        )
        still, *levers = (
            force @ tool_jacobian(replace(arm, X_tool=np.block([[np.eye(3), at], [0, 0, 0, 1]])), given.q)[0]
            for at in (np.zeros((3, 1)), *np.eye(3)[:, :, None])
        )
        along = np.linalg.svd(np.array(levers).T - still[:, None])[2][-1]
        away[:3, 3] = 0.1 * along + 0.05 * np.cross(along, [1.0, 0.0, 0.0])
        residual = -force @ tool_jacobian(replace(arm, X_tool=away), given.q) + 0.01 * rng.normal(
            size=(200, 6)
        )
        of = {"force": Estimate(force.tolist(), [0.1] * 3, "N")}
        of |= {"start": Estimate(0.2, 0.1, "s"), "end": Estimate(1.8, 0.1, "s")}
        nothing: Any = None
        rows = np.ones(200, dtype=bool)
        found = pushes.Contact(
            AddedEffect(effect("external_contact", None), of), rows, nothing, nothing, 0.9, 0.9
        )
        kind = pushes._Kind(effect("external_contact", None), 0, away[:3, 3])
        stated = pushes._at_a_point(evidence, residual, np.ones((200, 6)), found, kind, [])
        error = np.asarray(stated.added.parameters["point"].std_error)
        usual = 0.5 * np.linalg.norm(arm.X_PF[:, :3, 3], axis=1).max()
        np.testing.assert_allclose(error, usual * np.abs(along), atol=0.02 * usual)

    def test_a_force_on_the_tool_has_no_link(self) -> None:
        found = pushes._somewhere(self.at(0.0, 3.0), [self.at(4.5, 3.0)]).added.parameters
        assert set(found) == {"force"}


class TestIntervalOfAPush:
    KIND = SimpleNamespace(columns=lambda evidence, part: np.ones((len(part.time), 1, 1)))

    def found(self, burst: tuple[int, int], reach: float = 0.05, **of: Any) -> tuple[int, int]:
        given = motion(of.get("lengths", (200,)))
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=given, reach=reach, period=0.01))
        residual = np.zeros((given.samples, 1))
        residual[slice(*of.get("true", (50, 100)))] = 3.0
        kind: Any = self.KIND
        weight = np.ones_like(residual)
        weight[slice(*of.get("silent", (0, 0)))] = 0.0
        found = pushes._interval(evidence, residual, weight, slice(*burst), kind)
        return found.start, found.stop

    def test_it_is_where_the_push_explains_most_in_and_around_the_burst(self) -> None:
        assert self.found((40, 110)) == self.found((60, 80)) == self.found((55, 130)) == (50, 100)
        # no further than 0.3 s away
        assert self.found((90, 110), true=(40, 150)) == (60, 140)
        assert self.found((90, 100), true=(40, 150)) == (60, 130)
        # nor beyond its run
        assert self.found((90, 98), true=(40, 150), lengths=(100, 100))[1] == 100
        assert self.found((102, 110), true=(40, 150), lengths=(100, 100))[0] == 100

    def test_what_does_not_tell_of_it_is_no_part_of_it(self) -> None:
        """Where the joint rests before and after, a push is as long as it is seen."""
        assert self.found((60, 90), silent=(30, 65)) == (65, 100)
        assert self.found((60, 90), silent=(85, 130)) == (50, 85)

    def test_it_goes_on_while_its_joints_rest_if_it_shows_again_as_they_set_out(self) -> None:
        # for half a second and more, which is longer than it is sought to both sides where every sample tells
        assert self.found((60, 90), true=(50, 180), silent=(100, 160)) == (50, 180)
        assert self.found((170, 190), true=(50, 180), silent=(70, 160)) == (50, 180)
        assert self.found((60, 90), true=(50, 150), silent=(100, 160)) == (50, 100)
        # 0.3 s of samples that tell, no more
        assert self.found((70, 90), true=(50, 200), silent=(100, 160)) == (50, 180)

    def test_its_size_is_that_of_its_middle(self) -> None:
        # the reach, but no more than a fifth, is left aside at each end: of 20 samples four
        assert self.found((90, 96), true=(90, 93)) == (90, 96)  # an instant is none
        assert self.found((90, 94), reach=0.0, true=(90, 94)) == (90, 94)
        assert self.found((90, 110), true=(90, 94)) == (90, 110)
        assert self.found((90, 110), true=(90, 95), reach=1.0) == (90, 95)
        assert self.found((90, 110), true=(92, 110), reach=0.0) == (92, 110)
        # four samples are more than an instant
        assert self.found((88, 96), true=(90, 94), reach=0.0) == (90, 94)
        assert self.found((88, 96), true=(90, 93), reach=0.0) == (88, 96)


@pytest.mark.parametrize(
    ("silent", "start", "end"),
    [
        ((0, 0), 0.0, 0.0),
        ((120, 140), 0.2, 0.0),  # the joint rests for 0.2 s before it
        ((180, 190), 0.0, 0.1),
        ((110, 139), 0.0, 0.0),  # it was seen just before not to be there
        ((100, 140), 0.4, 0.0),  # since the run's start
        ((180, 200), 0.0, 0.2),  # to its end
    ],
)
def test_it_may_begin_and_end_wherever_nothing_tells_of_it(
    silent: tuple[int, int], start: float, end: float
) -> None:
    samples = SimpleNamespace(motion=motion((100, 100, 100)), period=0.01, reach=0.02)
    evidence: Any = SimpleNamespace(samples=samples)
    tells = np.ones(300, dtype=bool)
    tells[slice(*silent)] = False
    for rise in (0.0, 0.15):
        found = pushes._edge_errors(evidence, slice(140, 180), tells, rise)
        expected = [np.hypot(0.03, max(beside, rise) / np.sqrt(3)) for beside in (start, end)]
        assert found == pytest.approx(expected)


class TestTrialOfAPush:
    def trial(self, residual: np.ndarray, monkeypatch: pytest.MonkeyPatch, **of: float) -> Any:
        arm, given = three_axis(), motion((len(residual),), 3)
        samples = SimpleNamespace(motion=given, period=0.01, reach=of.get("reach", 0.02))
        evidence: Any = SimpleNamespace(
            samples=samples,
            scale=np.array([0.5, 1.0, 2.0]),
            variation=np.ones(3),
            model=SimpleNamespace(arm=arm),
        )
        monkeypatch.setattr(pushes, "_interval", lambda evidence, residual, weight, burst, kind: burst)
        kind = pushes._Kind(effect("external_torque", 1))
        return pushes._trial(
            evidence, residual, np.ones((len(residual), 3)) / evidence.scale, slice(20, 60), kind, [0]
        )

    def test_a_torque_is_found_with_its_interval_and_what_it_removes(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        residual = np.zeros((100, 3))
        residual[20:60, 0], residual[20:60, 2] = 2.0, 0.4
        found = self.trial(residual, monkeypatch)
        parameters = found.added.parameters
        assert (parameters["torque"].value, parameters["torque"].std_error) == pytest.approx((2.0, 0.0))
        assert (parameters["start"].value, parameters["end"].value) == pytest.approx((0.2, 0.59))
        assert parameters["start"].std_error == pytest.approx(0.03)
        np.testing.assert_allclose(found.before, [2.0, 0.0, 0.4])
        np.testing.assert_allclose(found.after, [0.0, 0.0, 0.4], atol=1e-12)
        # weighted by their baselines, 4 of joint 1 against 0.2 of joint 3
        assert found.share == pytest.approx(1 - 0.2**2 / (4.0**2 + 0.2**2))
        # what a joint that showed no event leaves there is not to be explained by one
        assert found.own == pytest.approx(1.0)
        assert self.trial(residual, monkeypatch, reach=0.0).added.parameters["end"].std_error == 0.01
        assert self.trial(0 * residual, monkeypatch) is None

    @pytest.mark.parametrize(("shown", "is_one"), [([0], True), ([0, 2], False)])
    def test_it_must_explain_the_joints_that_show_it(
        self, shown: list[int], is_one: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given = motion((100,), 3)
        samples = SimpleNamespace(motion=given, period=0.01, reach=0.02)
        evidence: Any = SimpleNamespace(
            samples=samples, scale=np.ones(3), variation=np.ones(3), model=SimpleNamespace(arm=three_axis())
        )
        monkeypatch.setattr(pushes, "_interval", lambda evidence, residual, weight, burst, kind: burst)
        residual = np.zeros((100, 3))
        residual[20:60, 0] = 2.0
        residual[20:60, 2] = np.where(np.arange(40) % 2, -3.0, 3.0)  # which no push is
        found = pushes.push(evidence, residual, slice(20, 60), np.ones((100, 3), dtype=bool), shown)
        assert (found is not None) == is_one

    @pytest.mark.parametrize(
        ("size", "variation", "tells", "sideways", "name"),
        [
            (2.0, 1.0, True, 0.0, "external_torque"),
            (0.4, 1.0, True, 0.0, "external_contact"),  # 0.6 baselines, as energy, are the model's own
            (2.0, 16.0, True, 0.0, "external_contact"),
            (2.0, 1.0, False, 0.0, "external_contact"),  # joint 3 says nothing, as where it rests
            (2.0, 1.0, True, 2.0, "external_contact"),  # which no torque on one joint explains
        ],
    )
    def test_what_it_surely_makes_worse_on_another_joint_is_no_force(
        self,
        size: float,
        variation: float,
        tells: bool,
        sideways: float,
        name: str,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """A force of f N upwards at the tool is 0.75 f N·m of joint 2 and 0.35 f of joint 3, which shows nothing."""
        monkeypatch.setattr(
            pushes, "FEW", 2
        )  # so that a force is what an arm of three joints feels above all
        monkeypatch.setattr(pushes, "MOSTLY", 0.6)
        monkeypatch.setattr(pushes, "is_told", lambda force: True)
        monkeypatch.setattr(pushes, "_interval", lambda evidence, residual, weight, burst, kind: burst)
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=motion((100,), 3), period=0.01, reach=0.02),
            scale=np.array([0.1, 0.1, 0.233]),
            variation=np.array([1.0, 1.0, variation]),
            model=SimpleNamespace(arm=three_axis()),
        )
        residual, counted = np.zeros((100, 3)), np.ones((100, 3), dtype=bool)
        residual[20:60, 0], residual[20:60, 1] = sideways, size
        counted[:, 2] = tells
        found = pushes.push(evidence, residual, slice(20, 60), counted, [0, 1])
        assert found is not None and found.added.effect.name == name

    def test_what_it_removes_is_counted_where_it_was_not_fitted(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        residual = np.zeros((100, 3))
        # a tenth of a second up, a tenth down, and so on: each half of the pieces foretells the other wrongly
        residual[20:60, 0] = np.where(np.arange(40) // 10 % 2, -1.0, 1.0)
        found = self.trial(residual, monkeypatch)
        assert found.share == pytest.approx(1 - 4.0)
        assert found.after[0] == pytest.approx(2.0)
        assert found.added.parameters["torque"].value == pytest.approx(0.0, abs=1e-12)
        # scores of four pieces, ±10 (of 0.5 N·m) each, over 40 samples
        assert found.added.parameters["torque"].std_error == pytest.approx(20 / 40)
