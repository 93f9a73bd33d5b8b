"""The stepwise method: static, constant-velocity and varying-velocity data, each step inheriting the last."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from armloop.data.motion import Motion
from armloop.data.regimes import Clusters, Condition, sort_samples
from armloop.data.signals import Conditioning, as_torque
from armloop.features.double_feature_set import DoubleFeatureSet
from armloop.identification.reconstruction.data import Data
from armloop.identification.reconstruction.excitation import check_excitation
from armloop.identification.reconstruction.found import Found
from armloop.identification.reconstruction.library import Find, Library
from armloop.identification.reconstruction.nearest_regime import Sorter
from armloop.identification.reconstruction.options import Options
from armloop.identification.reconstruction.refit import REFITTED, refit
from armloop.identification.reconstruction.revision import revised
from armloop.identification.reconstruction.sindy import sindy
from armloop.identification.reconstruction.step import PARTS, Part, StepPlan, regress_step
from armloop.identification.reconstruction.sums import Choice
from armloop.robot.arm import Arm
from armloop.util.errors import ExcitationError
from armloop.util.progress import Progress

# A condition counts as met if what should be absent in it is this much weaker than where it is present.
_PURITY = 0.1
# Joints up to which the double feature set is compared with other libraries.
_MOST_JOINTS = 4


def stepwise_on(arm: Arm, data: Data, options: Options, progress: Progress) -> Found:
    """Reconstruct in three steps (Sect. 3.2, 3.3).

    Where the log has no clean static or constant-velocity data, or a joint hardly moves in them, hard clusters would
    feed a step with what it must not see, or with nothing; then the three libraries are regressed together on all
    samples, their terms still labelled by step, and a note says so. So they are where the steps leave more than noise
    (:mod:`armloop.identification.reconstruction.revision`).

    Raises:
        ExcitationError: a joint does not move.
    """
    samples = data.reference.samples
    check_excitation(arm, samples)
    motion = as_torque(samples).motion
    clusters = sort_samples(motion, seed=options.seed)
    note = _impure(motion, clusters)
    sorter = Sorter(samples, clusters.condition)
    revolute = tuple(arm.revolute.tolist())
    if not note:
        try:
            found = _in_steps(arm, data, steps(revolute, options), sorter, clusters, options, progress)
            found.sorter = sorter
        except ExcitationError as error:
            note = f"{error}; all three steps are regressed together instead"
    if note:
        found = _in_steps(arm, data, _together(revolute, options), None, clusters, options, progress)
        found.notes.append(note)
    if refit(found, data, options.sparse.how):
        found.notes.append(REFITTED)
    return revised(found, data, revolute, options, progress)


def _in_steps(
    arm: Arm,
    data: Data,
    plans: list[StepPlan],
    sorter: Sorter | None,
    clusters: Clusters,
    options: Options,
    progress: Progress,
) -> Found:
    """One regression after the other, each on the samples of its condition; on all of them without a sorter."""
    found = Found(arm, friction=[[] for _ in arm.joints])
    for plan in plans:
        share = float(np.isin(clusters.condition, plan.conditions).mean())
        progress(f"{plan.name}: {share:.0%} of the samples")
        add_step(found, data, sorter, plan, options)
    return found


def add_step(found: Found, data: Data, sorter: Sorter | None, plan: StepPlan, options: Options) -> None:
    """Regress one step on what the steps found so far leave, and add it to them."""
    # A copy: what is found now must not be inherited by itself.
    inherited = Found(found.arm, list(found.components), [list(law) for law in found.friction])
    choice = Choice(sorter, plan.conditions, inherited)
    terms, friction, reports = regress_step(data, tuple(found.arm.revolute.tolist()), choice, plan, options)
    found.components += terms
    for law, more in zip(found.friction, friction, strict=True):
        law += more
    found.reports += reports


def steps(revolute: tuple[bool, ...], options: Options) -> list[StepPlan]:
    """The three steps, each with the orders worth trying."""
    first, second, third = PARTS
    return [
        StepPlan((first,), _orders(revolute, (first,), (0,), options), ("sign",), (1,)),
        StepPlan((second,), _orders(revolute, (second,), (1, 2), options), ("viscous", "stribeck"), (2,)),
        StepPlan((third,), _orders(revolute, (third,), (1,), options), (), (3,)),
    ]


def _together(revolute: tuple[bool, ...], options: Options) -> list[StepPlan]:
    orders = _orders(revolute, PARTS, (2,), options)
    return [StepPlan(PARTS, orders, ("sign", "viscous", "stribeck"), (1, 2, 3))]


def _orders(
    revolute: tuple[bool, ...], parts: tuple[Part, ...], second: tuple[int, ...], options: Options
) -> tuple[tuple[int, int], ...]:
    """Orders worth trying, smallest library first."""

    def size(order: tuple[int, int]) -> int:
        return sum(DoubleFeatureSet(revolute, *order, part.second).size for part in parts)

    tried = [(N1, N2) for N1 in range(1, options.max_order + 1) for N2 in second]
    tried = [order for order in tried if size(order) <= options.max_candidates] or tried[:1]
    return tuple(sorted(tried, key=size))


def _impure(motion: Motion, clusters: Clusters) -> str:
    """Empty if the three conditions are really there, else what is wrong with them."""
    speed, pull = np.abs(motion.v).sum(axis=1), np.abs(motion.vdot).sum(axis=1)
    counts = clusters.counts()
    members = {kind: clusters.condition == kind for kind in Condition}
    if min(counts.values()) < 100:
        return f"conditions {counts}: too few samples in one, so all three steps are regressed together"
    fast = float(np.median(speed[members[Condition.CONSTANT_VELOCITY]]))
    slow = float(np.median(speed[members[Condition.STATIC]]))
    steady = float(np.median(pull[members[Condition.CONSTANT_VELOCITY]]))
    shaken = float(np.median(pull[members[Condition.VARYING_VELOCITY]]))
    if slow > _PURITY * fast or steady > _PURITY * shaken:
        return (
            f"conditions {counts}: static data move with {slow:.2g} (constant-velocity {fast:.2g}), constant-velocity "
            f"data accelerate with {steady:.2g} (varying {shaken:.2g}): not clean, so all three steps are regressed together"
        )
    spread = np.ptp(motion.q[members[Condition.STATIC]], axis=0) / np.maximum(np.ptp(motion.q, axis=0), 1e-12)
    if spread.min() < 0.3:
        joint = int(np.argmin(spread)) + 1
        return f"static data cover {spread.min():.0%} of the range of q{joint}, so all three steps are regressed together"
    return ""


def _one_shot(arm: Arm, data: Data, options: Options, progress: Progress) -> Found:
    return sindy(arm, as_torque(data.reference.samples), data.reference.held_out, options, progress)


class DoubleFeatureSetLibrary(Library):
    """The paper's: every joint's torque by itself, without geometry."""

    name = "double-feature-set"
    methods: ClassVar[Mapping[str, Find]] = {"stepwise": stepwise_on, "sindy": _one_shot}
    conditioning = Conditioning(cutoff_hz=9.0)
    shared = False
    own_friction = (
        "the double feature set has friction of its own (Coulomb, Stribeck, terms of the velocities)"
    )

    def suits(self, arm: Arm) -> bool:
        """Up to four joints, beyond which it has more candidates than any log tells apart."""
        return arm.n <= _MOST_JOINTS

    def asked(self, options: Options) -> bool:
        """Whether the estimator, the orders or the noise are said."""
        return options.of_double_feature_set
