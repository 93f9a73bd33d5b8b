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
