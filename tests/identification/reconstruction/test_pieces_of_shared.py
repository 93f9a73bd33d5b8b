"""Which samples slide, how far joints go and what a motion must show, on numbers small enough to see through."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.data.motion import Motion, Samples
from armloop.features.rigid_body import BaseParameters
from armloop.identification.reconstruction import shared
from armloop.laws.friction import FrictionTerm
from armloop.util.errors import ExcitationError


class TestSharedSamples:
    def samples(self, v: np.ndarray, cutoff: float = 5.0, starts: tuple[int, ...] = (0,)) -> Any:
        motion = Motion(np.arange(len(v)) * 0.1, 0 * v, v, 0 * v, np.array(starts))
        return Samples(motion, 0 * v, np.abs(v) > 0.001, 0.1, cutoff_hz=cutoff)

    def test_steady_creep_keeps_direction_and_half_of_its_speed_over_a_period_of_the_corner(self) -> None:
        v = np.full((30, 1), 0.008)
        v[10], v[20] = 0.004, 0.0039
        # two samples to both sides
        steady = shared._steady(self.samples(v))[:, 0]
        assert np.flatnonzero(~steady).tolist() == [18, 19, 20, 21, 22]
        assert np.array_equal(shared._steady(self.samples(-v))[:, 0], steady)
        assert np.flatnonzero(~shared._steady(self.samples(v, starts=(0, 20)))[:, 0]).tolist() == [20, 21, 22]
        assert not shared._steady(self.samples(v, cutoff=0.0)).any()
        assert shared._steady(self.samples(np.full((30, 1), 0.008), cutoff=0.8)).all()
        assert not shared._steady(self.samples(np.zeros((30, 1)))).any()
        turn = np.where(np.arange(30) < 15, 0.008, -0.008)[:, None]
        assert np.flatnonzero(~shared._steady(self.samples(turn))[:, 0]).tolist() == [13, 14, 15, 16]

    def test_a_joint_slides_if_it_is_fast_or_creeps_steadily(self) -> None:
        v = np.full((30, 1), 0.02)
        v[20:] = -0.011
        samples = self.samples(v)
        assert shared.fast_rows(samples).all() and shared.sliding_rows(samples).all()
        v[20:] = -0.009
        samples = self.samples(v)
        assert np.flatnonzero(~shared.fast_rows(samples)[:, 0]).tolist() == [*range(20, 30)]
        assert np.flatnonzero(~shared.sliding_rows(samples)[:, 0]).tolist() == [20, 21]
        samples.moving[25] = False
        assert not shared.sliding_rows(samples)[25, 0]

    def test_the_range_of_a_motion(self) -> None:
        q = np.linspace(-1.0, 3.0, 1001)[:, None]
        motion = Motion(np.arange(1001.0), q, -q, 2 * q, np.array([0]))
        half, v, vdot, centre = shared.motion_range(motion)
        assert half == pytest.approx([0.5 * 0.99 * 4]) and centre == pytest.approx([1.0])
        # |v| spreads evenly from 0 to 1 twice, then to 3 once: its 0.995 quantile leaves 0.005 of the samples
        assert v == pytest.approx([3 - 0.005 * 4], abs=1e-9) and vdot == pytest.approx([2 * v[0]])

    def test_the_slowest_speed_of_what_is_fitted(self) -> None:
        """Speeds from 0.02 to 1.02 evenly, forth and back; what is slower is turned round or at rest."""
        v = np.concatenate([np.linspace(1.02, 0.02, 1001), np.zeros(200), -np.linspace(0.02, 1.02, 1001)])
        samples = self.samples(np.column_stack([v, 0 * v]), cutoff=0.0)
        samples.moving[1001:1201], samples.moving[:, 1] = False, False
        assert shared.slowest_sliding(samples) == pytest.approx([0.025, 0.0], abs=1e-3)

    def test_a_speed_that_a_joint_only_passes_through_is_not_known(self) -> None:
        """Moves at 0.4 rad/s from stop to stop with ramps of 0.2 s, through a low-pass that smears a tenth of a second."""
        move = np.concatenate([np.linspace(0.0, 0.4, 21), np.full(79, 0.4), np.linspace(0.4, 0.0, 21)])
        v = np.concatenate([sign * move for sign in (1, -1) * 10])[:, None]
        motion = Motion(np.arange(len(v)) * 0.01, 0 * v, v, 0 * v, np.array([0]))
        samples = Samples(motion, 0 * v, np.abs(v) > 0.01, 0.01, cutoff_hz=5.0)
        assert shared.slowest_sliding(samples)[0] >= 0.2
        held = Motion(motion.time, 0 * v, v / 20, 0 * v, motion.starts)
        slow = Samples(held, 0 * v, samples.moving, 0.01, cutoff_hz=5.0)
        assert shared.slowest_sliding(slow) == pytest.approx([0.02])

    def test_joints_must_move_and_terms_that_vanished_are_left_out(self) -> None:
        shared.check_moves(three_axis(), np.array([100, 100, 100]))
        with pytest.raises(
            ExcitationError, match=r"q2: .* moves in 99 samples, at least 100 .* --lock joint_2=V"
        ):
            shared.check_moves(three_axis(), np.array([100, 99, 0]))
        laws = [
            [FrictionTerm("viscous"), FrictionTerm("offset")],
            [FrictionTerm("hysteresis", parameter=0.01)],
        ]
        found = shared.found_friction(laws, np.array([1e-13, -2e-12, 3.0]))
        assert found == [[FrictionTerm("offset", -2e-12)], [FrictionTerm("hysteresis", 3.0, 0.01)]]

    def test_most_base_parameters_must_be_told_apart(self) -> None:
        base = BaseParameters.of_arm(three_axis())
        third = base.count // 3
        G = np.eye(base.count)
        assert shared.undetermined_notes(G, base) == []
        for weak in (third, third + 1):
            G[:weak, :weak] = 0.0
            (note,) = shared.undetermined_notes(G, base)
            assert f"does not determine {weak} of {base.count} inertial" in note and "; what" not in note
            if weak == third:
                shared.check_rank(G, base)
        with pytest.raises(ExcitationError, match=f"leaves {third + 1} of {base.count} inertial parameters"):
            shared.check_rank(G, base)

    def test_of_columns_that_are_alike_the_sum_is_known(self) -> None:
        base = BaseParameters.of_arm(three_axis())
        leads = [name.split(" ")[0] for name in base.names]
        assert any(" " in name for name in base.names[1:3])
        G = np.eye(base.count)
        G[1:3, 1:3] = 1.0
        (note,) = shared.undetermined_notes(G, base)
        assert note.startswith(f"the motion does not determine 1 of {base.count} inertial parameters")
        assert f"by themselves: {leads[2]} were taken" in note
        assert note.endswith(f"; what it determines is {leads[1]} + {leads[2]}")

    def test_the_plain_friction_follows_from_a_sample_alone(self) -> None:
        kinds = [term.kind for term in shared.PLAIN_FRICTION]
        assert kinds == ["offset", "smooth_sign", "viscous", "quadratic"]
