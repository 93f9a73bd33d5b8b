"""Caveats of a verdict: what a reader must know before relying on it, one true sentence with its number each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from armloop.data.motion import Samples
from armloop.diagnosis.evidence import (
    FAR,
    FEWEST_BLOCKS,
    Evidence,
    far_outside,
    seldom,
    shortest_block,
    sliding,
)
from armloop.diagnosis.judgement import MOSTLY, MULTIPLE, NEARLY_ALL, SIGNIFICANCE
from armloop.features.lagrangian import constant_weights
from armloop.identification.goodness import (
    WORTH_A_WORD,
    Parts,
    merged,
    outside_trained_range,
    parts_of,
    trained_range,
    witness,
)
from armloop.identification.scoring import known_from, too_slow
from armloop.identification.shared_motors import sharing
from armloop.identification.standstill import creep, mixed_in, sticking
from armloop.identification.uncertainty import usual_in_words
from armloop.laws.effects import Effect
from armloop.laws.effects.base import number
from armloop.laws.effects.events import ends
from armloop.laws.effects.found import RANGE
from armloop.laws.effects.load_dependent_friction import LoadDependentFriction
from armloop.laws.effects.torque_gain import TorqueGain
from armloop.laws.effects.torque_offset import TorqueOffset
from armloop.model import AddedEffect, ReconstructedModel
from armloop.util.arrays import Array, Mask


class _Law(Protocol):
    @property
    def joint(self) -> int: ...
    @property
    def parameters(self) -> Mapping[str, Any]: ...


#: Fewest moving samples of a joint that has moved.
_FEWEST = 20
#: A model that leaves so much of a joint's torque hides changes that a user would want to see.
_ROUGH = 0.2


@dataclass(frozen=True, eq=False)
class Standing:
    """How far a run can be judged by a model.

    Attributes:
        reasons: sentences.
        joints: entries of ``joints`` in ``diagnosis.json``.
        unknown: whether neither "nothing is there" nor "something is" can be said.
        left: joints (0-based) of which more than the baseline is left that nothing accounts for, and can be predicted, or is
            a multiple of which nobody knows whether it can.
    """

    reasons: list[str]
    joints: list[dict[str, Any]]
    unknown: bool
    left: tuple[int, ...] = ()


def standing(
    evidence: Evidence,
    augmented: ReconstructedModel,
    after: Sequence[float | None],
    explained: Sequence[int],
    found: bool = False,
) -> Standing:
    """How far a run can be judged, once everything found is in the augmented model, adopted or not.

    Args:
        after: per joint the held-out RMSE with everything found, an unlisted law included, N·m (N); NaN where a joint did
            not move.
        explained: joints (1-based) whose residual the verdict names already.
        found: whether anything was.
    """
    samples, model = evidence.samples, evidence.model
    left, bare = evidence.left_by(augmented), evidence.left_by(model)
    parts = parts_of(witness(left, samples, evidence.context.load))
    outside = outside_trained_range(samples.motion, trained := trained_range(model))
    strays, creeps = far_outside(samples.motion, trained), too_slow(model, samples)
    far = strays.mean(axis=0)
    slow = (creeps & samples.moving).sum(axis=0) / np.maximum(samples.moving.sum(axis=0), 1)
    slides = sliding(samples, model)
    rows = slides & ~strays & ~creeps
    few = seldom(model, samples, rows & ~mixed_in(model, samples, bare, evidence.scale, rows))
    reasons = [*_outside(outside, far), *_slow(model, samples, slow)]
    unknown, unexplained, judged, rough = False, [], 0, []
    multiples: list[bool | None] = []
    largest = 0.0
    for j, part in enumerate(parts):
        unknown |= bool(far[j] > NEARLY_ALL)
        if evidence.rows[:, j].sum() < _FEWEST:
            turns = np.abs(samples.motion.v[:, j]) > sticking(model)[j]
            sharers = sharing(model, j) if turns.sum() >= _FEWEST else []
            reasons.append(_uncounted(j, slides[:, j], strays[:, j], creeps[:, j], sharers, bool(few[j])))
            continue
        poor = _too_poor(model, j)
        if poor:
            reasons.append(poor)
            unknown = True
        of = after[j]
        ratio = np.nan if of is None else of / float(evidence.scale[j])
        judged += 1
        if not poor and _left_in_training(model, j) >= _ROUGH:
            rough.append(j)
        if poor or not ratio > 1:
            continue
        words, real = _multiple(part, j, ratio, found)
        if ratio >= MULTIPLE:
            multiples.append(real)
            largest = max(largest, ratio)
            reasons.append(words)
        if j + 1 not in explained:
            much = ratio >= MULTIPLE and real is not False
            unexplained += [j] if real or much else []
            # noise that is a multiple of what is said to be much may be anything, and hides what is smaller
            unknown |= much or ratio >= MULTIPLE**2
    reasons += _rough(model, rough)
    # noise, or what happened once, such as a hard stop that all joints feel, makes no other record
    most = len(multiples) > max(MOSTLY * judged, 1) and any(real is not False for real in multiples)
    # a run that is but faster than those that made the baseline leaves twice of it as well
    if most and largest >= MULTIPLE**2:
        reasons.insert(0, _all_over(model, len(multiples), judged))
    return Standing(reasons, merged(parts, outside), unknown, tuple(unexplained))


def _all_over(model: ReconstructedModel, multiples: int, judged: int) -> str:
    """A sentence on a run of which most joints leave a multiple of the baseline, whatever was found."""
    return (
        f"{multiples} of {judged} joints leave {MULTIPLE:g} times the baseline or more with all that was found: so much "
        "differs from the training logs that what is named may stand for something else; check that this is a log of "
        f"{model.arm.name} with its order of joints, zeros, units and drive gains"
    )


def too_still(evidence: Evidence) -> str:
    """What keeps a run from being judged, empty if nothing does."""
    turning = np.abs(evidence.samples.motion.v) > creep(evidence.model)
    uncounted = [j for j, rows in enumerate((evidence.rows & turning).T) if rows.sum() < _FEWEST]
    blocks = len(np.unique(evidence.blocks))
    if len(uncounted) < evidence.rows.shape[1] and blocks >= FEWEST_BLOCKS:
        return ""
    shortest = shortest_block(evidence.model)
    of = f"{blocks} blocks of {shortest:.2g} s or more"
    still = [j for j in uncounted if turning[:, j].sum() < _FEWEST]
    elsewhere = [j for j in uncounted if j not in still]
    of += f"; {_named(still)} hardly slide{'s' * (len(still) == 1)}" if still else ""
    how = ", as fast as in training" if elsewhere else ""
    if elsewhere:
        of += f"; {_named(elsewhere)} slide{'s' * (len(elsewhere) == 1)} hardly where, and as fast as, the model was trained"
    seconds = (FEWEST_BLOCKS + 1) * shortest
    return f"too little motion to judge ({of}); log at least {seconds:.2g} s in which the joints move{how}"


def _named(joints: Sequence[int]) -> str:
    """Such as ``joints 1, 2``, of joints (0-based)."""
    return f"joint{'s' * (len(joints) > 1)} {', '.join(str(j + 1) for j in joints)}"


def spaced(label: str) -> str:
    """An effect's label in words."""
    return label.replace("_", " ")


def in_doubt(label: str, share: float) -> str:
    """A sentence on an effect that removes less than what nothing accounts for where it acts."""
    return (
        f"{spaced(label)} would remove {share:.0%} of what can be explained, but more is left there that nothing accounts "
        "for: it may be of the same origin, and is not stated"
    )


def masked(labels: Sequence[str]) -> list[str]:
    """A sentence on effects that are plain in the run, but no larger than what the model itself may err by."""
    if not labels:
        return []
    is_no, it_is = ("is no", "it is") if len(labels) == 1 else ("are no", "they are")
    labels = [spaced(label) for label in labels]
    which = " and ".join(filter(None, [", ".join(labels[:-1]), labels[-1]]))
    return [
        f"{which} would explain some of what is left there, but {is_no} larger than what the model's own coefficients may "
        f"be wrong by, friction that differs from log to log and zeros of torques that do among them: {it_is} not stated"
    ]


class _Named(Protocol):
    @property
    def effect(self) -> Effect: ...
    @property
    def always(self) -> bool: ...


def unlike(names: Sequence[str], others: Sequence[tuple[Sequence[str], Sequence[str]]]) -> str:
    """A sentence on logs in which the arm was not the same.

    Args:
        names: of the logs that all else is said of.
        others: names of the others, and what was found in them.
    """
    there = "; ".join(f"in {', '.join(logs)}: {', '.join(found).replace('_', ' ')}" for logs, found in others)
    return (
        "the arm was not the same in all logs, or not at the same times, and they were judged apart: all else here is said "
        f"of {', '.join(names)} ({there})"
    )


def of_too_few_logs(model: ReconstructedModel, found: Sequence[_Named]) -> list[str]:
    """A sentence on friction that is found by a model of too few logs to tell the variance between them."""
    rubbing = [spaced(f.effect.label()) for f in found if f.effect.rubs and not f.always]
    if not rubbing or model.uncertainty.get("between_logs_known") != "assumed":
        return []
    return [
        "the model's logs are too few to tell by how much the friction of this arm differs from run to run, as where drives "
        f"warm up; it was taken to be {usual_in_words()} of it, and {', '.join(rubbing)} may be no more than that of an arm "
        "that differs by more: a model of several logs knows"
    ]


def too_little(label: str, joints: Sequence[int], share: float, small: bool, errors: float) -> str:
    """A sentence on a law that is no chance in the run at joints (0-based), and not stated, because it is small or else.

    Args:
        errors: by how many of its stated errors it is clear of nothing.
    """
    if small:
        why = "it explains no more than the model leaves at its worst on its own training logs"
    elif errors < SIGNIFICANCE:
        why = (
            f"it is {errors:.1f} of its stated errors from none, which hold what the model itself may err by"
        )
    else:
        why = "it does not pass all that is asked of a law"
    return (
        f"{_named(joints)}: {spaced(label)} would explain {share:.0%} of what is left beyond the baseline, which is no "
        f"chance; it is not stated, for {why}"
    )


def part_of_a_law(labels: Sequence[str], joint: int, share: float, times: float) -> str:
    """A sentence on effects that explain a part (of the energy) of what a law does, and leave so many times more (RMS)."""
    return (
        f"{spaced(' and '.join(labels))} would explain {share:.0%} of joint {joint}'s residual, but leave {times:.1f} "
        "times what the law does that is stated in place of it"
    )


def of_a_constant_pull(model: ReconstructedModel, added: Sequence[AddedEffect]) -> list[str]:
    """A sentence on each offset of a torque reading of a slide that lifts one weight at all postures: it may be a weight."""
    upright = constant_weights(model.arm)
    offsets = [a for a in added if isinstance(a.effect, TorqueOffset) and a.effect.index in upright]
    return [
        f"joint {a.effect.joint} lifts one weight at all postures: a counterweight that has become lighter or heavier, or a "
        f"spring that holds it, is a constant force of {a.parameters['offset'].words()} as well, and no motion tells it "
        "from the sensor; if it is that, a controller must supply as much in addition"
        for a in offsets
    ]


def of_an_efficiency(added: Sequence[AddedEffect]) -> list[str]:
    """A sentence on each gain of a torque reading beside friction that grows with the load: it may be one cause."""
    rubs = {a.effect.joint: a for a in added if isinstance(a.effect, LoadDependentFriction)}
    found = []
    for a in added:
        if isinstance(a.effect, TorqueGain) and a.effect.joint in rubs:
            mu = number(rubs[a.effect.joint].parameters["coefficient"].value)
            more = number(a.parameters["gain"].value) - 1
            found.append(
                f"joint {a.effect.joint}: a gear that loses {mu + more:.3g} of the load while it drives it and "
                f"{mu - more:.3g} while the load drives it leaves the same record as friction that grows with the load and "
                "a sensor's gain beside it: one cause, of the arm, for which a controller must supply both parts; a known "
                "weight held at rest tells the gain of a sensor"
            )
    return found


def of_a_balancer(model: ReconstructedModel, laws: Sequence[_Law]) -> list[str]:
    """A sentence on each law of its own angle alone at a joint that a spring with levers pulls at: it may be the spring."""
    sprung = {a.effect.joint for a in model.effects if a.effect.name in ("spring_balancer", "counterbalance")}
    return [
        f"joint {law.joint} has a spring that pulls by levers: one that has lost force, or its gas, leaves just such a law "
        "of the joint's angle alone"
        for law in laws
        if law.joint in sprung
        and law.parameters
        and not any("v" in name for name in set(law.parameters) - set(RANGE))
    ]


def event_in_doubt(event: AddedEffect) -> str:
    """A sentence on an event that removes no more than twice what nothing accounts for at other times."""
    start, end = ends(event.parameters)
    return (
        f"from {start:.1f} to {end:.1f} s {spaced(event.effect.label())} would explain what is left, but half as much or "
        "more is left there at other times that nothing accounts for: it may be of the same origin, and is not stated"
    )


def event_unclear(event: AddedEffect, clear: float) -> str:
    """A sentence on an event that is within two of its stated errors of none (Wald test)."""
    start, end = ends(event.parameters)
    return (
        f"from {start:.1f} to {end:.1f} s {spaced(event.effect.label())} would explain what is left, but it is {clear:.1f} "
        "of its stated errors from none, which hold what is left at other times: it is not stated"
    )


def event_untold(event: AddedEffect) -> str:
    """A sentence on an event of a run that is too short to tell it from a law."""
    start, end = ends(event.parameters)
    return (
        f"from {start:.1f} to {end:.1f} s {spaced(event.effect.label())} would explain what is left, but the rest of the "
        "run is too short, or leaves too much, to tell it from a law of the motion: it is not stated"
    )


def _uncounted(
    j: int, slides: Mask, strays: Mask, creeps: Mask, sharers: Sequence[int] = (), few: bool = False
) -> str:
    """Why next to nothing counts of a joint, by its samples (N,).

    Args:
        sharers: joints (0-based) that share a motor with it, where it turns all the same.
        few: whether what counts is but a few moments between its turns.
    """
    if slides.sum() < _FEWEST:
        if sharers:
            return (
                f"joint {j + 1} turns, but the motor that it shares with joint {' and '.join(str(k + 1) for k in sharers)} "
                "stands still in this run, and holds what its friction may: nothing can be said of it"
            )
        return f"joint {j + 1} does not slide in this run: nothing can be said of it"
    if (slides & ~strays).sum() < _FEWEST:
        where = f"beyond {FAR:g} times the range the model was trained on"
    elif (slides & ~strays & ~creeps).sum() < _FEWEST:
        where = f"slower than it was trained at, or beyond {FAR:g} times the range"
    elif few:
        counts = int((slides & ~strays & ~creeps).sum())
        return (
            f"joint {j + 1} counts in but {counts} samples, while it turns in far more: it turns round before its torque "
            "can be told from that of the turn, or is where the model was not trained; nothing can be said of it"
        )
    else:
        return f"joint {j + 1} slides only within events: nothing else can be said of it"
    return f"joint {j + 1} slides only {where}: nothing can be said of it"


def _outside(outside: Array, far: Array) -> list[str]:
    """A sentence on the joints of whose samples parts (n,) lie outside the trained range, and far outside."""
    said, beyond = [], f" beyond {FAR:g} times the range"
    for j in np.flatnonzero(outside > WORTH_A_WORD):
        words = f"{outside[j]:.0%} of joint {j + 1}'s"
        if far[j] > 0:
            words += f" ({'less than 1%' if far[j] < 0.01 else format(far[j], '.0%')}{beyond})"
            beyond = ""
        said.append(words)
    if not said:
        return []
    rest = "" if beyond else f"; what lies beyond {FAR:g} times the range was not judged"
    return [f"samples outside the range the model was trained on: {', '.join(said)}{rest}"]


def _slow(model: ReconstructedModel, samples: Samples, slow: Array) -> list[str]:
    """A sentence on the joints that slide too slowly to be judged in a part (n,) of the samples that they move in."""
    if not (slow > WORTH_A_WORD).any():
        return []
    speeds = known_from(model, samples)
    said = [
        f"{slow[j]:.0%} of joint {j + 1}'s (below {speeds[j]:.2g} {'rad/s' if model.arm.revolute[j] else 'm/s'})"
        for j in np.flatnonzero(slow > WORTH_A_WORD)
    ]
    return [
        f"samples in which a joint slides slower than it was trained at, which were not judged: {', '.join(said)}"
    ]


def _too_poor(model: ReconstructedModel, j: int) -> str:
    """A sentence on a model that leaves most of a joint's torque, RMS: it judges nothing there; else empty."""
    share = _left_in_training(model, j)
    if share < MOSTLY:
        return ""
    joints = model.baseline.get("joints") or []
    said = Parts(**joints[j]) if j < len(joints) else Parts(j + 1)
    if said.much_is_left:
        return said.sentence()
    return f"joint {j + 1}: the model leaves {share:.0%} of the torque on its own training logs: it judges nothing there"


def _left_in_training(model: ReconstructedModel, j: int) -> float:
    """RMS of what a model leaves of a joint on its own training logs, as a part of that of the torque; 0 if nobody knows."""
    own = model.baseline.get("nrmse") or []
    return float(own[j]) if j < len(own) and own[j] is not None else 0.0


def _rough(model: ReconstructedModel, joints: Sequence[int]) -> list[str]:
    """A sentence on joints (0-based) of which the model leaves much of the torque, if not most: it hides what is smaller."""
    if not joints:
        return []
    shares = ", ".join(f"{_left_in_training(model, j):.0%} of joint {j + 1}'s torque" for j in joints)
    return [
        f"on its own training logs the model leaves {shares}: what changes by less than that hardly shows there"
    ]


def _multiple(part: Parts, j: int, ratio: float, found: bool = False) -> tuple[str, bool | None]:
    """A sentence on a residual that nothing accounts for, and whether it is more than noise; None if nobody knows.

    Args:
        found: whether it is what something that was found leaves.
    """
    size = f"joint {j + 1}: {'what is left' if found else 'the residual'} is {ratio:.1f} times the baseline"
    left, error, noise = part.predictable_left, part.std_error, part.noise
    if left is None or error is None or noise is None:
        what = (
            "too weak or too short on this run to be named; the motion of --next-run would show it"
            if ratio < MULTIPLE**2
            else "and no listed effect nor a law that is stated accounts for it, as of play in a gear; the motion of "
            "--next-run may tell more"
        )
        return f"{size}: something is there, {what}", True
    much = (1 - NEARLY_ALL) * (left + noise)
    if left > max(SIGNIFICANCE * error, much):
        return (
            f"{size}, and {left / (left + noise):.0%} of its energy can be predicted from the motion, but no listed effect "
            "nor a law that is stated accounts for it",
            True,
        )
    if part.separated and left + error <= much:
        return (
            f"{size}, but a regression on the motion predicts little of it on blocks left out: noise (of the sensor, or of "
            "a joint that chatters, as with play in its gears), what happened once, or what this run shows too seldom",
            False,
        )
    return f"{size}; whether it can be predicted from the motion, this run does not tell", None
