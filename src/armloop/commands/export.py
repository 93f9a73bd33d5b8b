"""Write a model for other tools, read back and compared."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armloop.commands.arguments import REFUSE_OTHERS, Json
from armloop.commands.options import argument, option, required, several
from armloop.util.outputs import take_file, take_folder

if TYPE_CHECKING:
    from armloop.export import Exported
    from armloop.model import ReconstructedModel

HELP = "write a model as URDF, SDFormat, MJCF (MuJoCo), a Drake program or C, read it back and compare the torques"
EXAMPLE = (
    "armloop export model.json --to mjcf --out arm.xml\n"
    "  armloop export model.json --to c --out arm.c\n"
    "  armloop export model.json --to drake --out arm_in_drake"
)


class Export(Json):
    """The options."""

    model: str = argument("MODEL.json")
    to: str = required(
        "urdf and sdf: link inertias, rotors, damping; mjcf: dry friction and springs too; drake: a folder with the arm and "
        "a program that has all of the model; c: one C99 file with the torques",
        choices=("urdf", "sdf", "mjcf", "drake", "c"),
    )
    out: str = required("the file to write (drake: the folder)", metavar="PATH")
    log: list[str] = several(
        "compare on this log's motion (may be repeated) instead of random states within the training range",
        "LOG",
    )
    arm: str | None = option(REFUSE_OTHERS)


def run(options: Export) -> None:
    """Export."""
    from armloop.commands.shared import print_json, read_logs
    from armloop.data.signals import preprocess
    from armloop.export import export, states_of
    from armloop.model import load_model
    from armloop.robot.arm import load_arm

    if options.to == "drake":
        take_folder(options.out)
    else:
        take_file(options.out, "--out")
    model = load_model(options.model, load_arm(options.arm) if options.arm else None)
    motion = None
    if options.log:
        samples = preprocess(read_logs(options.log, model.arm, model.recorded), model.conditioning)
        motion = states_of(samples.motion, samples.moving)
    found = export(model, options.to, options.out, motion)
    if options.json:
        print_json(found.to_dict())
        return
    _tell(found, model, bool(options.log))


def _tell(found: Exported, model: ReconstructedModel, by_log: bool) -> None:
    from armloop.reports.tables import table
    from armloop.reports.words import unit, wrapped

    states = "states of the log" if by_log else "random states within the training range"
    if found.difference is not None and found.unsaid is not None:
        print(f"read back by {found.consumer}, on {states}; largest difference of torque:")
        rows = []
        for j, joint in enumerate(model.arm.joints):
            of = unit(model.torque_units[j])
            values = (found.rms[j], found.difference[j], found.unsaid[j])
            rows.append([f"{j + 1}  {joint.name}", of, *(f"{x:.3g}" for x in values)])
        heads = ["joint", "unit", "RMS of the model", "of what it can say", "of the whole model"]
        print(table(heads, rows))
    if found.missing:
        print("what it cannot say:")
        for line in found.missing:
            print(wrapped(line, "  "))
    for line in found.notes:
        print(wrapped(line, "  "))
    for path in found.files:
        print(f"wrote {path}")
