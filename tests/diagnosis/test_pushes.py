"""Which force or torque a push is: the simplest of those that explain as much, where an arm can tell them apart."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic import three_axis

from armloop.data.motion import Motion
from armloop.diagnosis import pushes
from armloop.diagnosis.event_size import event_size_error
from armloop.laws.effects import Estimate, effect
from armloop.laws.effects.external_contact import is_told
from armloop.robot.arm import load_arm
from armloop.util.arrays import TINY

Shares = dict[str, float]


class TestChoice:
    """Trials of given shares: t1, t2, … a torque on a joint, f0 a force on the tool, f3, … on a link."""

    def pushed(
        self,
        monkeypatch: pytest.MonkeyPatch,
        shares: Shares,
        joints: int = 7,
        own: Shares | float = 0.9,
        shown: Any = (0, 1),
        tool: float = 0.1,
        told: bool = True,
    ) -> tuple[str, list[tuple[str, int | None, float]]] | None:
        asked: list[str] = []
        weights: list[Any] = []

        def trial(evidence: Any, residual: Any, weight: Any, burst: Any, kind: Any, shown: Any) -> Any:
            name = f"t{kind.effect.joint}" if kind.effect.joint else f"f{kind.link}"
            if kind.point is not None:
                name = f"p{kind.point[0]:g}"
            asked.append(name)
            weights.append(weight)
            if name not in shares:
                return None
            nothing: Any = None
            noticed = own if isinstance(own, float) else own[name]
            return pushes.Contact(
                SimpleNamespace(name=name, parameters={"force": None}),
                nothing,
                nothing,
                nothing,
                shares[name],
                noticed,
            )  # type: ignore[arg-type]

        monkeypatch.setattr(pushes, "_trial", trial)
        self.beyond: list[Any] = []
        self.alone: list[int | None] = []

        def somewhere(found: Any, points: Any, beyond: Any = None, alone: int | None = None) -> Any:
            self.beyond.append(beyond)
            self.alone.append(alone)
            return found

        monkeypatch.setattr(pushes, "_somewhere", somewhere)
        monkeypatch.setattr(pushes, "is_told", lambda force: told)
        monkeypatch.setattr(
            pushes, "_off_the_links", lambda *_: ("beyond", np.ones(3), shares.get("beyond", 0.0))
        )
        self.alike: list[tuple[float, float]] | None = None

        def at_a_point(evidence: Any, residual: Any, weight: Any, found: Any, kind: Any, alike: Any) -> Any:
            assert kind.point.tolist() == [1, 1, 1]
            self.alike = [(p.share, part) for p, part in alike]
            return found

        monkeypatch.setattr(pushes, "_at_a_point", at_a_point)
        X_tool = np.eye(4)
        X_tool[2, 3] = tool
        evidence: Any = SimpleNamespace(
            model=SimpleNamespace(arm=SimpleNamespace(n=joints, X_tool=X_tool)), scale=np.array([0.5, 4.0])
        )
        nothing: Any = None
        counted = np.array([[True, True], [True, False]])
        found = pushes.push(evidence, nothing, slice(0, 2), counted, list(shown))
        links = [f"f{link}" for link in range(joints - 1 if tool else joints, 2, -1)]
        if not tool and joints < 3:
            links = [f"f{joints}"]
        first = [*(f"t{j + 1}" for j in shown), "f0", *links, *(["p1"] if not tool and joints > 3 else [])]
        # where a force may act besides, only its error asks
        of = "" if found is None else "f" if not told else found.added.name[0]  # type: ignore[attr-defined]
        besides = {
            "f": [f"f{k / 2}" for k in range(1, 2 * joints + 1)],
            "p": ["p0.5", "p0.75", "p1.25", "p1.5"],
        }
        assert asked == first + besides.get(of, [])
        assert weights[0].tolist() == [[2.0, 0.25], [2.0, 0.0]]
        if found is None:
            return None
        assert found.share == shares[found.added.name]  # type: ignore[attr-defined]
        assert found.own == (own if isinstance(own, float) else own[found.added.name])  # type: ignore[attr-defined]
        return found.added.name, [(e.name, e.joint, share) for e, share in found.rivals]  # type: ignore[attr-defined]

    def test_on_an_arm_of_more_than_three_joints_it_is_a_force_if_that_explains_as_much(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        torque = ("external_torque", 1)
        assert self.pushed(monkeypatch, {"t1": 0.9, "f0": 0.86}, 4) == ("f0", [(*torque, 0.9)])
        assert self.alone == [1]
        assert self.pushed(monkeypatch, {"t1": 0.9, "f0": 0.84}, 4) == ("t1", [])
        # two or three joints feel it as they feel a torque, which is simpler: of the joints that show it
        more = {"t1": 0.7, "f0": 0.9}
        found = self.pushed(monkeypatch, more, 3, own={"t1": 0.86, "f0": 0.9})
        assert found == ("t1", [("external_contact", None, 0.9)])
        assert self.pushed(monkeypatch, more, 3, own={"t1": 0.84, "f0": 0.9}) == ("f0", [])
        assert self.pushed(monkeypatch, more, 4, own={"t1": 0.9, "f0": 0.9}) == ("f0", [])
        # or of all
        found = self.pushed(monkeypatch, {"t1": 0.86, "f0": 0.9}, 3, own={"t1": 0.7, "f0": 0.9})
        assert found == ("t1", [("external_contact", None, 0.9)])

    def test_a_force_smaller_than_its_own_error_is_the_torque_that_explains_as_much(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        force = ("external_contact", None, 0.9)
        shares = {"t1": 0.87, "t2": 0.88, "f0": 0.9}
        found = self.pushed(monkeypatch, shares, told=False)
        assert found == ("t2", [force, ("external_torque", 1, 0.87)])
        # if there is one
        assert self.pushed(monkeypatch, {"t1": 0.5, "f0": 0.9}, told=False) == ("f0", [])
        for error, told in ((0.9, True), (1.1, False)):
            given = Estimate([0.0, 3.0, 0.0], [0.0, 3.0 * error, 9.0], "N")
            assert is_told(given) is told

    def test_on_the_tool_before_a_link_and_of_links_or_joints_the_one_that_explains_most(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # a force on a link is no other effect than one on the tool
        assert self.pushed(monkeypatch, {"f0": 0.86, "f5": 0.9}) == ("f0", [])
        assert self.pushed(monkeypatch, {"f0": 0.5, "f4": 0.88, "f5": 0.9}) == ("f5", [])
        assert self.pushed(monkeypatch, {"t1": 0.88, "t2": 0.9}) == ("t2", [("external_torque", 1, 0.88)])

    def test_where_no_tool_is_known_it_may_be_on_the_last_link(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.pushed(
            monkeypatch, {"t1": 0.6, "f0": 0.4, "f3": 0.9}, 3, own={"t1": 0.6, "f0": 0.4, "f3": 0.9}, tool=0.0
        ) == ("f3", [])
        assert self.pushed(monkeypatch, {"t1": 0.6, "f2": 0.9}, 2, own={"t1": 0.6, "f2": 0.9}, tool=0.0) == (
            "f2",
            [],
        )
        # where it explains no more than one at the last joint's place, that is named
        assert self.pushed(monkeypatch, {"f0": 0.86, "f4": 0.9}, 4, tool=0.0) == ("f0", [])

    def test_where_no_tool_is_known_what_the_last_link_holds_may_have_been_pushed(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Where that explains surely more than a force on any link, or than a torque."""
        assert self.pushed(monkeypatch, {"f0": 0.86, "p1": 0.9}, 4, tool=0.0) == ("f0", [])
        assert self.alike is None
        shares = {"f0": 0.84, "t1": 0.84, "p1": 0.9, "p0.5": 0.84, "p0.75": 0.86, "p1.25": 0.95}
        assert self.pushed(monkeypatch, shares, 4, tool=0.0) == ("p1", [])
        # it may have been nearer or farther away
        assert self.alike == [(0.86, 0.75), (0.95, 1.25)]
        assert self.pushed(monkeypatch, {"t1": 0.96, "p1": 0.9}, 4, tool=0.0) == ("t1", [])
        force = ("external_contact", None, 0.9)
        assert self.pushed(monkeypatch, {"t1": 0.89, "p1": 0.9}, 4, tool=0.0) == ("t1", [force])

    @pytest.mark.parametrize(
        ("shares", "joints", "handed_on"),
        [
            ({"f0": 0.9, "beyond": 0.9}, 7, ["beyond"]),
            ({"f4": 0.9, "beyond": 0.94}, 7, [None]),  # of a link the joints beyond it feel nothing
            ({"f4": 0.9, "beyond": 0.96}, 7, ["beyond"]),  # unless it explains surely more
            ({"f0": 0.9, "beyond": 0.99}, 3, [None]),  # which three joints cannot tell
            ({"t1": 0.9, "beyond": 0.99}, 7, []),
        ],
    )
    def test_what_holds_more_than_the_links_may_have_been_pushed_where_all_joints_feel_it(
        self, shares: Shares, joints: int, handed_on: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.pushed(monkeypatch, shares, joints)
        assert self.beyond == handed_on

    def test_it_must_explain_half_of_the_joints_that_showed_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.pushed(monkeypatch, {"f0": 0.9}, own=0.5) == ("f0", [])
        assert self.pushed(monkeypatch, {"f0": 0.9}, own=0.49) is None
        assert self.pushed(monkeypatch, {}) is None


class TestParameters:
    """What a trial tells of a push of 2 N·m, or of 2 N along each axis, on twenty samples."""

    def trial(
        self, monkeypatch: pytest.MonkeyPatch, kind: Any, arm: Any, samples: int = 40, **of: Any
    ) -> Any:
        given = Motion(np.arange(float(samples)) * 0.01, *np.zeros((3, samples, arm.n)), np.array([0]))
        given.q[:] = np.linspace(0.1, 0.5, samples)[:, None] * np.arange(1, arm.n + 1)
        best = slice(10, of.get("end", 30))
        monkeypatch.setattr(pushes, "_best_interval", lambda *_: best)
        reach = of.get("reach", 0.0)
        evidence: Any = SimpleNamespace(
            samples=SimpleNamespace(motion=given, period=0.01, reach=reach),
            scale=np.ones(arm.n),
            variation=np.ones(arm.n),
            model=SimpleNamespace(arm=arm),
        )
        columns = kind.columns(evidence, given)
        residual = columns @ np.full(columns.shape[2], 2.0) * of.get("size", 1.0)
        inside = (np.arange(samples) >= 10) & (np.arange(samples) < of.get("end", 30))
        residual *= of.get("profile", inside)[:, None]
        weight = np.ones((samples, arm.n))
        weight[of.get("silent", slice(0)), 0] = 0.0
        return pushes._trial(evidence, residual, weight, slice(7, 30), kind, of.get("shown", [0]))

    def test_a_torque_has_its_joints_unit_and_the_posture_where_it_began(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        arm = load_arm("scara")
        made = self.trial(monkeypatch, pushes._Kind(effect("external_torque", 3)), arm, shown=[2])
        found = made.added.parameters
        assert made.clear == pytest.approx(found["torque"].value / max(found["torque"].std_error, TINY))
        assert found["torque"].value == pytest.approx(2.0) and found["torque"].unit == "N"
        assert found["posture"].unit == "rad or m"
        assert (found["start"].value, found["end"].value) == pytest.approx((0.1, 0.29))
        first = np.linspace(0.1, 0.5, 40)[10]
        np.testing.assert_allclose(found["posture"].value, first * np.arange(1, 5))
        assert found["start"].std_error == 0.01
        found = self.trial(monkeypatch, pushes._Kind(effect("external_torque", 1)), three_axis(), reach=0.1)
        assert (
            found.added.parameters["torque"].unit == "N*m" and found.added.parameters["posture"].unit == "rad"
        )
        assert found.added.parameters["start"].std_error == pytest.approx(0.15)

    def test_what_comes_and_goes_smoothly_may_have_begun_while_it_rose(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Of a raised cosine from 0.005 to 0.385 s the stretch from half of its height on is stated."""
        off = (np.arange(40) * 0.01 - 0.195) / 0.19
        smooth = np.where(np.abs(off) < 1, np.cos(np.pi * off / 2) ** 2, 0.0)
        kind = pushes._Kind(effect("external_torque", 1))
        for profile, rise in ((smooth, 0.095), ((np.abs(off) < 0.5) * 1.0, 0.0)):
            found = self.trial(monkeypatch, kind, three_axis(), profile=profile).added.parameters
            assert (found["start"].value, found["end"].value) == pytest.approx((0.1, 0.29))
            for edge in ("start", "end"):
                assert found[edge].std_error == pytest.approx(np.hypot(0.01, rise / np.sqrt(3)))

    @pytest.mark.parametrize("link", [0, 3])
    def test_a_force_has_its_link_unless_that_is_the_tool(
        self, link: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        kind = pushes._Kind(effect("external_contact", None), link)
        found = self.trial(monkeypatch, kind, three_axis(), shown=[0, 1, 2])
        force = found.added.parameters["force"]
        np.testing.assert_allclose(force.value, 2.0, rtol=0.05)
        assert force.unit == "N" and found.share == pytest.approx(1.0) and found.own == pytest.approx(1.0)
        assert ("link" in found.added.parameters) == (link > 0)
        assert link == 0 or found.added.parameters["link"].value == 3.0

    def test_of_the_pieces_that_tell_of_it_every_other_is_held_out(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Three pieces, in the middle one of which the joint turns round: the first judges the last, and conversely."""
        kind = pushes._Kind(effect("external_torque", 1))
        found = self.trial(monkeypatch, kind, three_axis(), end=38, silent=slice(19, 28))
        assert found.share == found.own == pytest.approx(1.0)
        # one piece alone judges nothing
        assert self.trial(monkeypatch, kind, three_axis(), end=38, silent=slice(19, 38)).share == 0.0

    def test_what_no_joint_showed_has_no_own_part(self, monkeypatch: pytest.MonkeyPatch) -> None:
        kind = pushes._Kind(effect("external_torque", 1))
        assert self.trial(monkeypatch, kind, three_axis(), shown=[1]).own == 0.0
        assert self.trial(monkeypatch, kind, three_axis(), size=0.0) is None
        assert replace(kind).link == 0


@pytest.mark.parametrize("link", [0, 2.5])
def test_the_error_of_a_force_counts_that_the_point_it_acts_on_is_not_known(
    link: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three joints feel a force halfway along the last link as a larger one there, or another one on the tool."""
    arm, there = three_axis(), np.array([3.0, -2.0, 4.0])
    given = Motion(0.01 * np.arange(60.0), *np.zeros((3, 60, 3)), np.array([0]))
    given.q[:] = [0.3, -0.4, 0.9]
    kind = pushes._Kind(effect("external_contact", None), link)
    evidence: Any = SimpleNamespace(
        samples=SimpleNamespace(motion=given, period=0.01, reach=0.02),
        scale=np.full(3, 1e-3),
        variation=np.ones(3),
        model=SimpleNamespace(arm=arm),
    )
    residual = kind.columns(evidence, given) @ there
    monkeypatch.setattr(pushes, "_interval", lambda evidence, residual, weight, burst, kind: burst)
    found = pushes.push(evidence, residual, slice(20, 50), np.ones((60, 3), dtype=bool), [0, 1, 2])
    assert found is not None and found.added.effect.name == "external_contact"
    force = found.added.parameters["force"]
    off = np.abs(np.asarray(force.value) - there)
    assert (off <= 2.0 * np.asarray(force.std_error)).all()
    assert np.linalg.norm(np.asarray(force.std_error)) > 0.1 * np.linalg.norm(there)


class TestInterval:
    """A push of the size 2 from sample 20 to 39 of a joint, looked for within 30 samples of a burst."""

    def found(
        self, burst: slice, reach: float = 0.0, starts: tuple[int, ...] = (0,), **other: float
    ) -> tuple[int, int]:
        N = 100
        y = np.zeros((N, 1))
        y[20:40] = 2.0
        for key, value in other.items():
            y[int(key[1:])] = value
        motion = Motion(0.01 * np.arange(N), *np.zeros((3, N, 1)), np.array(starts))
        evidence: Any = SimpleNamespace(samples=SimpleNamespace(motion=motion, period=0.01, reach=reach))
        kind: Any = SimpleNamespace(columns=lambda evidence, part: np.ones((part.samples, 1, 1)))
        one = pushes._interval(evidence, y, np.ones_like(y), burst, kind)
        return one.start, one.stop

    def test_it_grows_and_shrinks_to_the_push(self) -> None:
        for burst in (slice(24, 36), slice(30, 36), slice(18, 42)):
            assert self.found(burst, 0.04) == (20, 40)
        assert self.found(slice(30, 34)) == (20, 40)
        for short in (slice(30, 33), slice(30, 32)):  # its middle is too short to tell a size
            assert self.found(short) == (short.start, short.stop)
        assert self.found(slice(30, 35), 0.04) == (30, 35)

    def test_the_size_is_that_of_the_middle(self) -> None:
        # half of it explains a sample as well as nothing does
        assert self.found(slice(18, 42), 0.04, _19=0.9, _40=0.9) == (20, 40)
        assert self.found(slice(18, 42), 0.04, _19=1.1, _40=1.1) == (19, 41)

    def test_it_stays_within_its_run_and_begins_with_it(self) -> None:
        assert self.found(slice(26, 36), starts=(0, 26)) == (26, 40)
        assert self.found(slice(22, 26), starts=(0, 28)) == (20, 28)
        assert self.found(slice(20, 36), 0.04, starts=(0, 20), _20=1.1) == (20, 40)


def test_a_torque_explains_most_of_its_joint_or_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def trial(evidence: Any, residual: Any, weight: Any, burst: slice, kind: Any, shown: list[int]) -> Any:
        asked.append((weight[0].tolist(), kind.effect.place, shown))
        return answers[len(asked) - 1]

    answers = [SimpleNamespace(own=0.5), SimpleNamespace(own=0.49), None]
    monkeypatch.setattr(pushes, "_trial", trial)
    evidence: Any = SimpleNamespace(scale=np.array([2.0, 4.0]))
    for named in (answers[0], None, None):
        found = pushes.torque_on(evidence, np.zeros((1, 2)), slice(0, 1), np.array([[False, True]]), 1)
        assert found is named
    assert asked == [([0.0, 0.25], ("external_torque", 2, None), [1])] * 3


class TestBestInterval:
    """A burst from sample 20 to 79 that is low but for a pulse of ten samples, or of which all is as high."""

    def evidence(self, period: float = 0.01) -> Any:
        motion = Motion(period * np.arange(100), *np.zeros((3, 100, 1)), np.array([0]))
        return SimpleNamespace(samples=SimpleNamespace(motion=motion, period=period, reach=0.0))

    def found(self, *pulses: tuple[slice, float]) -> tuple[int, int]:
        y = np.zeros((100, 2))
        for rows, size in pulses:
            y[rows, 0] = size
        y[:, 1] = 9.0  # shown by no one
        kind: Any = SimpleNamespace(columns=lambda evidence, part: np.ones((part.samples, 1, 1)) * [[1], [0]])
        one = pushes._best_interval(self.evidence(), y, np.ones_like(y), slice(20, 80), kind, [0])
        return one.start, one.stop

    def test_a_high_part_counts_more_than_a_long_low_one(self) -> None:
        """Six samples of 4 explain 96, a mean of 1.12 over all of them 75; six of 3 54, a mean of 1.02 62."""
        assert self.found((slice(20, 80), 0.8), (slice(30, 36), 4.0)) == (30, 36)
        assert self.found((slice(20, 80), 0.8), (slice(30, 36), 3.0)) == (20, 80)
        assert self.found((slice(20, 80), -0.8), (slice(60, 66), -4.0)) == (60, 66)

    def test_interval_and_size_are_found_in_turn_three_times(self, monkeypatch: pytest.MonkeyPatch) -> None:
        moved: list[slice] = []

        def interval(evidence: Any, residual: Any, weight: Any, burst: slice, kind: Any) -> slice:
            moved.append(burst)
            return slice(burst.start + 1, burst.stop)

        monkeypatch.setattr(pushes, "_interval", interval)
        self.found((slice(30, 40), 6.0))
        assert [b.start for b in moved] == [20, 21, 22, 25, 26, 27]

    def test_the_peak_is_what_is_above_half_of_it_and_no_shorter_than_an_event(self) -> None:
        def peak(*level: float, before: int = 0, period: float = 0.05) -> tuple[int, int]:
            weighted = np.zeros((100, 1))
            weighted[before : before + len(level), 0] = level
            burst = slice(before, before + len(level))
            found = pushes._peak(self.evidence(period), weighted, burst)
            return found.start, found.stop

        assert peak(0, 1, 2, 3, -4, 2, 1, 0) == (2, 6)
        assert peak(0, 1, 2, 3, -4, 2, 1, 0, before=7) == (9, 13)
        assert peak(4, 3, 2, 2) == (0, 4)
        assert peak(0, 0, 0, 9, 0, 0, period=0.05) == (2, 4)
        assert peak(0, 0, 0, 9, 0, 0, period=0.025) == (1, 5)
        assert peak(0, 0, 0, 9, period=0.025) == (1, 4)


def test_the_error_of_a_force_is_that_of_independent_pieces_and_unbounded_where_it_is_not_felt() -> None:
    rng = np.random.default_rng(8)
    columns, left = rng.normal(size=(30, 2, 3)), rng.normal(size=(30, 2))
    pieces, size = np.repeat(np.arange(6), 5), np.array([3.0, -1.0, 2.0])
    bread = np.linalg.inv(sum(a.T @ a for a in columns))
    scores = [sum(columns[k].T @ left[k] for k in range(5 * p, 5 * p + 5)) for p in range(6)]
    spread = bread @ sum(np.outer(s, s) for s in scores) @ bread
    assert_allclose(event_size_error(columns, size, left, pieces), np.sqrt(np.diag(spread)))
    columns[:, :, 1] = 0.0
    found = event_size_error(columns, size, left, pieces)
    two = event_size_error(columns[:, :, [0, 2]], size[[0, 2]], left, pieces)
    assert_allclose(found, [two[0], np.sqrt(14.0), two[1]])


def test_a_margin_is_a_pause_long() -> None:
    pause = pushes.PAUSE
    time = np.array([-1.01 * pause, -pause, -0.5 * pause, 0.0, 0.5 * pause, pause, 1.01 * pause])
    motion = Motion(time, *np.zeros((3, 7, 1)), np.array([0]))
    assert np.flatnonzero(pushes.around(motion, slice(3, 4))).tolist() == [1, 2, 3, 4, 5]
