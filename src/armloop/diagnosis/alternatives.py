"""Why two effects can look alike on one motion, and which motion would tell them apart."""

from __future__ import annotations

from armloop.effects import Effect

_WHY: dict[frozenset[str], str] = {
    frozenset({"torque_offset", "joint_spring"}): (
        "over a small range a spring is a constant; a run over a larger range of the joint would tell them apart"
    ),
    frozenset({"torque_offset", "coulomb_friction"}): (
        "while the joint moves one way an offset and dry friction are the same column; a run in both directions "
        "would tell them apart"
    ),
    frozenset({"coulomb_friction", "viscous_friction"}): (
        "at one speed both are one level; a run at several speeds would tell them apart"
    ),
    frozenset({"rotor_inertia", "payload"}): (
        "both resist acceleration; a run with the arm held at several postures, where only a payload weighs, "
        "would tell them apart"
    ),
    frozenset({"rotor_inertia", "joint_spring"}): (
        "near one frequency acceleration and position are proportional; a run at several frequencies would tell them apart"
    ),
    frozenset({"gravity_tilt", "payload"}): (
        "both change the gravity load; a run with fast and slow motion at the same postures would tell them apart"
    ),
    frozenset({"gravity_tilt", "torque_offset"}): (
        "over a small range a tilt is a constant; a run over all postures would tell them apart"
    ),
    frozenset({"torque_offset", "friction_asymmetry"}): (
        "a joint that rubs harder one way needs the same constant torque as a sensor that is off; no motion tells them "
        "apart, but the reading of an unloaded, unpowered drive does"
    ),
    frozenset({"coulomb_friction", "load_dependent_friction"}): (
        "under a constant load both are one level; a run at postures with different loads would tell them apart"
    ),
    frozenset({"coulomb_friction", "friction_drift"}): (
        "over a run that is short against the warming up both are one level; a longer run would tell them apart"
    ),
    frozenset({"coulomb_friction", "presliding_hysteresis"}): (
        "once the joint slides both are one level; a run with many short reversals would tell them apart"
    ),
    frozenset({"coulomb_friction", "stribeck_friction"}): (
        "at low speeds both are one level; a run at several constant speeds would tell them apart"
    ),
    frozenset({"quadratic_drag", "viscous_friction"}): (
        "near one speed both are one level; a run at several speeds up to the fastest would tell them apart"
    ),
    frozenset({"encoder_offset", "gravity_tilt"}): (
        "both turn gravity against a link; a run with fast motion at different postures would tell them apart; for the "
        "first joint only a spirit level does"
    ),
    frozenset({"encoder_offset", "joint_spring"}): (
        "over a small range a shifted gravity torque is a spring; a run over the whole range would tell them apart"
    ),
    frozenset({"torque_gain", "payload"}): (
        "both scale the torque of gravity; a run in which friction or inertia dominate would tell them apart"
    ),
    frozenset({"rotor_inertia", "transmission_coupling"}): (
        "while one of the two joints hardly moves both are the same inertia; a run that moves both would tell them apart"
    ),
    frozenset({"torque_offset", "payload"}): (
        "over few postures a load is a constant; a run over all postures would tell them apart"
    ),
    frozenset({"torque_offset", "torque_gain"}): (
        "where the torque hardly changes, a part of it is a constant; a run at postures with different loads would tell "
        "them apart"
    ),
    frozenset({"torque_offset", "encoder_offset"}): (
        "over few postures a shifted gravity torque is a constant; a run over the whole range would tell them apart"
    ),
    frozenset({"torque_offset", "torque_ripple"}): (
        "over a small part of its period a ripple is a constant; a run over several periods would tell them apart"
    ),
    frozenset({"joint_spring", "torque_ripple"}): (
        "over a small part of its period a ripple is a straight line; a run over several periods would tell them apart"
    ),
    frozenset({"joint_spring", "torque_gain"}): (
        "over a small range the torque changes in proportion to the angle; a run over the whole range, fast and slow, "
        "would tell them apart"
    ),
    frozenset({"joint_spring", "gravity_tilt"}): (
        "over a small range turned gravity is a spring; a run over all postures would tell them apart"
    ),
    frozenset({"viscous_friction", "transmission_coupling"}): (
        "while the other joint hardly moves both are drag; a run that moves both joints, with and against each other, would "
        "tell them apart"
    ),
    frozenset({"coulomb_friction", "transmission_coupling"}): (
        "while the other joint hardly moves both are dry friction; a run that moves both joints, with and against each "
        "other, would tell them apart"
    ),
}
#: While a joint slides this is a constant: what holds of a constant torque holds of it.
_CONSTANT = "friction_asymmetry"


def why_alike(found: Effect, rival: Effect) -> str:
    """A sentence for the ``alternatives`` of a diagnosis."""
    pair = frozenset({found.name, rival.name})
    like_a_constant = frozenset("torque_offset" if name == _CONSTANT else name for name in pair)
    listed = _WHY.get(pair, _WHY.get(like_a_constant))
    if listed and _meet(found, rival):
        return listed
    return (
        f"on this motion {rival.label()} explains held-out data nearly as well as {found.label()}; a run over other "
        "postures and speeds may tell them apart: armloop diagnose --next-run designs one"
    )


def _meet(found: Effect, rival: Effect) -> bool:
    """Whether the sentence is about one joint, or about effects of the whole arm."""
    return found.joint is None or rival.joint is None or found.joint == rival.joint
