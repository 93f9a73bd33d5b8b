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
        "both turn gravity against a link; a run with fast motion at different postures, or a spirit level, would tell "
        "them apart"
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
}


def why_alike(found: Effect, rival: Effect) -> str:
    """A sentence for the ``alternatives`` of a diagnosis."""
    listed = _WHY.get(frozenset({found.name, rival.name}))
    if listed and (found.joint == rival.joint or found.joint is None or rival.joint is None):
        return listed
    return (
        f"on this motion {rival.label()} explains held-out data nearly as well as {found.label()}; a run that moves "
        "one joint at a time, at several speeds over its whole range, would tell them apart"
    )
