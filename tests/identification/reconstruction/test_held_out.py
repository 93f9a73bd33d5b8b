"""Blocks that judge the model take no part in any choice: not of the low-pass, not of laws, friction or ripples."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis, with_noise

from armloop.data.log import MotionLog
from armloop.data.signals import Conditioning, preprocess
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.reconstruction.bandwidth import choose_bandwidth
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.held_out import held_out_intervals, within
from armloop.identification.reconstruction.reconstruct import default_conditioning
from armloop.identification.reconstruction.rigid_body import rigid_body
from armloop.identification.reconstruction.ripple import find_ripple
from armloop.model import ReconstructedModel
from armloop.util.progress import silent

PLAIN = Options(standard_errors=False, parts=False)
OPTIONS = replace(PLAIN, block_seconds=4.0)
USUAL = default_conditioning("rigid-body")


def run(seed: int = 3, seconds: float = 40.0, noise: float = 0.0) -> MotionLog:
    """An arm with a spring and a ripple; ``noise`` on v, rad/s, makes corners differ."""
    motion = fourier_motion(seconds, 125.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau[:, 1] += 6.0 * (motion.q[:, 1] - 0.3)
    tau[:, 0] += 0.3 * np.sin(101 * motion.q[:, 0])
    log = measured(motion, tau, seed)
    return with_noise(log, noise, seed)


def spoilt(log: MotionLog, intervals: np.ndarray, inside: float = 0.0) -> MotionLog:
    """Noise instead of the torque in the intervals, further than ``inside`` seconds from their ends."""
    rows = within(log.time, intervals, -inside)
    tau = np.where(rows[:, None], 30 * np.random.default_rng(0).normal(size=log.tau.shape), log.tau)
    assert 0.05 < rows.mean() < 0.3
    return replace(log, tau=tau)


def test_the_intervals_are_those_of_the_blocks_that_are_held_out() -> None:
    logs = [run(3), run(4, 22.0)]
    for cutoff_hz in (2.5, 10.0):
        how = replace(USUAL, cutoff_hz=cutoff_hz)
        chunks = [part.chunk() for part in Data.kept(logs, how, OPTIONS).parts]
        for log, chunk, intervals in zip(logs, chunks, held_out_intervals(logs, [how], OPTIONS), strict=True):
            assert chunk is not None and log.samples
            held = within(chunk.samples.motion.time, intervals, 1e-9)
            np.testing.assert_array_equal(held, chunk.held_out)


def test_the_low_pass_is_chosen_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    log = run(noise=0.1)
    corners = [Conditioning(cutoff_hz=10.0 * part) for part in (1.0, 0.71, 0.5, 0.35, 0.25)]
    (intervals,) = held_out_intervals([log], corners, OPTIONS)
    # a filter of no finite response: what it carries over half a second is not nothing, but next to it
    other = spoilt(log, intervals, 0.8)

    def chosen(log: MotionLog) -> np.ndarray:
        return np.array(choose_bandwidth([log], three_axis(), Conditioning(), OPTIONS, [USUAL]).trials)

    one, same = chosen(log), chosen(other)
    assert np.ptp(one[:, 1]) > 0.01
    np.testing.assert_allclose(same, one, rtol=1e-3)
    # were they not left aside, it would show
    monkeypatch.setattr(
        "armloop.identification.reconstruction.bandwidth.within",
        lambda time, *_: np.zeros(len(time), dtype=bool),
    )
    assert chosen(other)[:, 1].min() > 2 * one[:, 1].max()


@pytest.mark.slow
def test_laws_friction_and_ripple_are_chosen_and_fitted_without_them() -> None:
    log, arm = run(), three_axis()
    samples = preprocess([log], USUAL)
    held = Chunk.of(samples, OPTIONS).held_out
    noise = 30 * np.random.default_rng(0).normal(size=samples.tau.shape)
    other = replace(samples, tau=np.where(held[:, None], noise, samples.tau))
    one, same = (rigid_body(arm, Data.of(s, OPTIONS, held), OPTIONS, silent) for s in (samples, other))
    assert [added.effect.name for added in one.effects] == ["joint_spring", "torque_ripple"]
    assert one.effects[1].parameters["order"].value == 101
    assert [a.parameters for a in one.effects] == [b.parameters for b in same.effects]
    assert one.friction == same.friction and one.history == same.history
    for mine, theirs in zip(one.components, same.components, strict=True):
        assert mine.to_dict() == theirs.to_dict()
    # the model that is handed out is regressed on all of them
    assert one.final is not None and same.final is not None and one.final.friction != same.final.friction

    # nor are those that are looked for in what the model leaves, here without the ripple
    model = ReconstructedModel(arm, tuple(one.components), one.law, USUAL, effects=one.effects[:1])
    (intervals,) = held_out_intervals([log], [USUAL], OPTIONS)
    ripples = [find_ripple(model, [own], samples, held) for own in (log, spoilt(log, intervals, 0.5))]
    assert [added.parameters["order"].value for added in ripples[0]] == [101]
    for mine, theirs in zip(*ripples, strict=True):
        assert {k: v.value for k, v in mine.parameters.items()} == pytest.approx(
            {k: v.value for k, v in theirs.parameters.items()}, rel=1e-3
        )


def test_few_held_out_blocks_are_not_halved() -> None:
    """A short log's library is chosen on another fold; all held-out blocks judge a model that has not seen them."""
    log = run(seconds=16.0)
    found = reconstruct(
        [log],
        three_axis(),
        options=Options(standard_errors=False, parts=False, friction=("coulomb", "viscous")),
    )
    (taken,) = [one for one in found.libraries if one.chosen]
    (left,) = [one for one in found.libraries if not one.chosen]
    assert taken.attempt is not None and left.attempt is not None
    data, nested = taken.attempt.data.reference, left.attempt.data.reference
    assert data.choosing is None and found.held_out.samples == data.judging("all", taken.attempt.margin).sum()
    assert not (nested.judging("selection") & data.held_out).any()
    np.testing.assert_array_equal(nested.judging("test"), data.held_out)
    np.testing.assert_array_equal(nested.judging("selection") | data.held_out, nested.held_out)
