"""Preprocessing chosen from the logs: low-pass, lag of the torque, encoders' zeros, and the blocks that are held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

from armloop.data.log import MotionLog
from armloop.data.pieces import LogSource
from armloop.data.signals import Conditioning, too_short
from armloop.identification.reconstruction.bandwidth import Bandwidth, choose_bandwidth, highest_corner
from armloop.identification.reconstruction.block_length import FEWEST_BLOCKS, Blocks, independent_blocks
from armloop.identification.reconstruction.encoder_zeros import EncoderZeros, encoder_zeros
from armloop.identification.reconstruction.held_out import held_out_intervals
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.torque_lag import Beside, TorqueLag, torque_lag
from armloop.robot.arm import Arm
from armloop.util.arrays import Array
from armloop.util.progress import Progress


@dataclass(frozen=True, eq=False)
class Prepared:
    """Logs as they are going to be regressed, and how.

    Attributes:
        logs: the runs, their encoders' zeros corrected; read when needed where ``kept`` is empty.
        kept: the same, of logs that are kept in memory.
        options: with the length of the held-out blocks.
        given: the filter, where the caller has said which.
        lag: where the torque is out of step with the motion.
        zeros: where the encoders of several logs were compared.
        aside: per log, (B, 2) instants, s, between which a block is held out.
    """

    logs: Sequence[LogSource]
    kept: Sequence[MotionLog]
    options: Options
    given: Conditioning | None
    bandwidth: Bandwidth
    blocks: Blocks
    lag: TorqueLag | None
    zeros: EncoderZeros | None
    aside: Sequence[Array]

    @property
    def late(self) -> float:
        """By how much the torque is later than the motion, s; 0 where nothing is clear."""
        return self.lag.seconds if self.lag else 0.0

    @property
    def runs(self) -> Sequence[LogSource]:
        """The logs, in memory where they are."""
        return self.kept or self.logs

    def conditioning(self, usual: Conditioning) -> Conditioning:
        """The filter for a library that would usually have this one."""
        how = self.given or self.bandwidth.suited(usual)
        return replace(how, torque_lag=self.late)

    def history(self) -> dict[str, Any]:
        """What of it the model's history holds."""
        found: dict[str, Any] = {}
        if self.bandwidth.trials:
            found["bandwidth"] = self.bandwidth.to_dict()
        if self.zeros is not None and self.zeros.found:
            found["encoder_zeros"] = self.zeros.to_dict(self.kept)
        if self.lag is not None:
            found["torque_lag"] = self.lag.to_dict()
        return found

    def notes(self, arm: Arm, how: Conditioning) -> list[str]:
        """What the user should know of it.

        Args:
            how: the filter that was taken in the end.
        """
        zeros = self.zeros.notes(arm) if self.zeros is not None and self.zeros.found else []
        late = self.lag.notes() if self.lag is not None else []
        return [*self.bandwidth.notes(), *_too_short(self.kept, how), *zeros, *late]

    def few_held_out(self, usual: Conditioning) -> bool:
        """Whether half of the held-out blocks are too few to judge by."""
        if not self.kept or self.options.folds <= 2:
            return False
        held_out = held_out_intervals(self.kept, [self.given or self.bandwidth.suited(usual)], self.options)
        return sum(map(len, held_out)) < 2 * FEWEST_BLOCKS


def prepared(
    logs: Sequence[LogSource],
    kept: Sequence[MotionLog],
    arm: Arm,
    usual: Sequence[Conditioning],
    given: Conditioning | None,
    options: Options,
    progress: Progress,
    *,
    corrected: bool = True,
    beside: Beside | None = None,
) -> Prepared:
    """Choose how logs are preprocessed.

    Args:
        logs: as the user has given them.
        kept: the same in memory; empty where they are read when needed.
        usual: filters of the libraries that are going to be regressed.
        given: the filter, where the user has said which.
        corrected: whether the torque's lag and the encoders' zeros are looked for.
        beside: what is known of the arm where the torque's lag is looked for.
    """
    runs = kept or logs
    known = options.torque_lag
    late, corners = None if known is None else TorqueLag.known(known, arm.n), set[float]()
    while True:
        lag = late.seconds if late else 0.0
        bandwidth, blocks = _filter_and_blocks(
            runs, arm, [given] if given else usual, options, given is None, progress, lag
        )
        dealt = replace(options, block_seconds=blocks.seconds, correlation_seconds=blocks.correlation)
        filters = sorted({given or bandwidth.suited(one) for one in usual}, key=astuple)
        aside = held_out_intervals(runs, filters, dealt) if bandwidth.cutoff_hz > 0 else []
        if bandwidth.cutoff_hz in {0.0, *corners} or not corrected or known is not None:
            break
        corners.add(bandwidth.cutoff_hz)
        progress("whether the torque is in step with the motion")
        found = torque_lag(runs, arm, filters[0], aside, blocks.seconds, beside)
        if not found.seconds:
            break
        # what is out of step asks for a low corner, and a lag is known best at a high one
        late = found
    zeros = None
    if kept and bandwidth.cutoff_hz > 0 and corrected:
        zeros = encoder_zeros(kept, arm, bandwidth.cutoff_hz, aside, blocks.correlation)
        logs = kept = zeros.corrected(kept)
    return Prepared(logs, kept, dealt, given, bandwidth, blocks, late, zeros, aside)


def _filter_and_blocks(
    logs: Sequence[LogSource],
    arm: Arm,
    usual: Sequence[Conditioning],
    options: Options,
    choosing: bool,
    progress: Progress,
    torque_lag: float = 0.0,
) -> tuple[Bandwidth, Blocks]:
    """The low-pass, and the blocks that are held out: from it, too.

    How long blocks must be depends on the low-pass, and they are held out from its choice: where a lower corner asks for
    longer ones, it is chosen anew.

    Args:
        usual: filters of the libraries that are going to be regressed.
        choosing: whether the corner is chosen; else it is the usual one.
        torque_lag: of the logs, s.
    """
    highest = Conditioning(torque_lag=torque_lag)

    def blocks_at(bandwidth: Bandwidth) -> Blocks:
        how = replace(bandwidth.suited(usual[0]), torque_lag=torque_lag)
        return independent_blocks(arm, logs, how, options.block_seconds, options.folds)

    if not choosing:
        bandwidth = Bandwidth(usual[0].cutoff_hz)
        return bandwidth, blocks_at(bandwidth)
    progress("choosing the low-pass on blocks that judge nothing else")
    bandwidth = Bandwidth(highest_corner(logs, highest))
    seconds, blocks = 0.0, blocks_at(bandwidth)
    while blocks.seconds > seconds:
        seconds, before = blocks.seconds, bandwidth.cutoff_hz
        dealt = replace(options, block_seconds=seconds)
        bandwidth = choose_bandwidth(logs, arm, highest, dealt, usual)
        if bandwidth.cutoff_hz != before:
            blocks = blocks_at(bandwidth)
    return bandwidth, blocks.within(seconds)


def _too_short(logs: Sequence[MotionLog], how: Conditioning) -> list[str]:
    """A line on runs that are too short for the filter: what only they show, the model does not know."""
    lost = {log.name: count for log in logs if (count := too_short(log, how))}
    if not lost:
        return []
    part = sum(lost.values()) / sum(log.samples for log in logs)
    return [
        f"{part:.0%} of the samples lie in runs of less than {how.shortest:.3g} s, too short for a low-pass of "
        f"{how.cutoff_hz:.3g} Hz, and are left out ({', '.join(lost)}); a higher --cutoff would use them"
    ]
