"""Turn logs of other programs into a motion log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from armloop.commands.arguments import ARM_HELP, Chain, Json, Recorded, drive_gains, tau_unit
from armloop.commands.options import argument, flag, option
from armloop.util.errors import InputError
from armloop.util.outputs import take_file

if TYPE_CHECKING:
    from armloop.convert import Converted
    from armloop.robot.arm import Arm

HELP = (
    "turn other programs' logs (ROS bags, RTDE, libfranka, LeRobot, .mat, .npz, any table) into a motion log"
)
EXAMPLE = (
    "armloop convert bag_folder --arm ur10e.urdf --tau-unit N*m --out run.parquet\n"
    "  armloop convert rtde.csv --drive-gains 12.5,12.5,12.5,9.2,9.2,9.2 --out run.parquet\n"
    "  armloop convert table.csv --suggest --map map.yaml     then complete map.yaml, and\n"
    "  armloop convert table.csv --map map.yaml --out run.parquet"
)


class Convert(Chain, Recorded, Json):
    """The options."""

    sources: list[str] = argument(
        "SOURCE",
        "a ROS bag (folder, .db3, .mcap, .bag), CSV of RTDE or libfranka, a LeRobot data set, .mat, .npz or a table",
        nargs="+",
    )
    out: str | None = option("the log to write, .parquet or .csv", metavar="LOG")
    arm: str | None = option(f"match the joints by name with those of {ARM_HELP}")
    map: str | None = option("what the columns are (with --suggest: where to write it)", metavar="MAP.yaml")
    suggest: bool = flag(
        "write a map from the header instead of a log, to --map (else beside --out), and say what is unsure"
    )
    tau_unit: str | None = tau_unit(
        "what effort, current or torque columns hold, where the source does not say"
    )
    drive_gains: str | None = drive_gains("N·m/A per joint: turn motor currents into torques")
    angle_unit: str | None = option(
        "of positions and velocities, where the source does not say", choices=("rad", "deg")
    )
    topic: str | None = option("which joint states of a bag with several")


def run(options: Convert) -> None:
    """Convert, or suggest a map."""
    from armloop.commands.shared import print_json, recorded_as, stated_arm
    from armloop.convert import Answers, convert, read_map
    from armloop.data.tables import CSV, PARQUET, kind_of, write_columns
    from armloop.data.torque_unit import said_of_unit

    arm = stated_arm(options)
    recorded = recorded_as(options, {"unit": None, "drive_gains": None})
    if options.suggest:
        _suggest(options, arm)
        return
    if options.out is None:
        raise InputError("convert: --out is missing; give the log to write, such as --out run.parquet")
    out = Path(options.out)
    take_file(out, "--out")
    if kind_of(out) not in (CSV, PARQUET):
        raise InputError(f"{out}: unknown suffix {out.suffix!r}; --out must end in .parquet or .csv")
    mapping = read_map(options.map) if options.map else None
    answers = Answers(recorded["unit"], recorded["drive_gains"], options.angle_unit)
    found = convert(options.sources, arm=arm, mapping=mapping, answers=answers, topic=options.topic)
    write_columns(out, found.columns(), said_of_unit(found.log.tau_unit))
    if not options.json:
        _tell(found, out, arm)
        return
    log = found.log
    print_json(
        {
            "log": str(out),
            "kinds": found.kinds,
            "samples": log.samples,
            "period": log.period,
            "runs": [[run.start, run.stop] for run in log.runs()],
            "joints": found.joints,
            "tau_unit": log.tau_unit,
            "kept": list(found.extra),
            "notes": found.notes,
        }
    )


def _suggest(options: Convert, arm: Arm | None) -> None:
    from armloop.commands.shared import print_json
    from armloop.convert import doubts, read_sources, suggested, written
    from armloop.util.files import write_text

    place = None
    if options.map is not None:
        place = Path(options.map)
    elif options.out is not None:
        out = Path(options.out)
        place = out if out.suffix in (".yaml", ".yml") else out.with_suffix(".map.yaml")
    if place is not None:
        if place.exists() and not options.force:
            raise InputError(
                f"{place}: exists; --suggest writes a new map, give another name with --map, or add --force"
            )
        take_file(place, "--map")
    recording = read_sources(options.sources[:1], arm, options.topic)[0]
    mapping, unsure = suggested(recording, arm)
    text = written(mapping, unsure, recording)
    if place is not None:
        write_text(place, text)
    known = "?" not in mapping.q.names()
    if options.json:
        print_json(
            {
                "map": None if place is None else str(place),
                "kind": recording.kind,
                "samples": recording.samples,
                "joints": mapping.n if known else 0,
                "unsure": unsure,
                "text": text,
            }
        )
        return
    if place is None:
        print(text, end="")
        return
    joints = f"{mapping.n} joint{'s' if mapping.n > 1 else ''}" if known else "how many joints is not clear"
    print(f"{recording.path.name}: {recording.kind}, {recording.samples} rows, {joints}")
    for note in recording.notes:
        print(f"  {note}")
    for line in doubts(unsure):
        print(f"  unsure of {line}")
    if not unsure:
        print("  nothing is unsure; the map is not needed, but shows what will be read")
    step = "complete it, then" if unsure else "to read the file by it"
    print(f"wrote {place}; {step}: armloop convert {recording.path} --map {place} --out LOG.parquet")


def _tell(found: Converted, out: Path, arm: Arm | None) -> None:
    import numpy as np

    from armloop.convert.recording import some
    from armloop.reports.tables import table

    log, runs = found.log, found.log.runs()
    seconds = sum(float(log.time[run.stop - 1] - log.time[run.start]) for run in runs)
    print(
        f"{', '.join(dict.fromkeys(found.kinds))}: {log.samples} samples at {1 / log.period:.4g} Hz, {seconds:.4g} s, "
        f"{len(runs)} run{'s' if len(runs) > 1 else ''}"
    )
    rows = [
        [
            j + 1,
            "" if arm is None else arm.joints[j].name,
            found.joints[j],
            f"{log.q[:, j].min():.4g} … {log.q[:, j].max():.4g}",
            f"{np.abs(log.v[:, j]).max():.4g}",
            f"{np.abs(log.tau[:, j]).max():.4g}",
        ]
        for j in range(log.joints)
    ]
    unit = "A" if log.tau_unit == "A" else "N·m"
    print(
        table(["joint", "arm", "source", "q, rad (m)", "largest |v|, rad/s", f"largest |tau|, {unit}"], rows)
    )
    for note in found.notes:
        print(f"  {note}")
    if found.extra:
        print(f"  kept beside it: {some(found.extra, 12)}")
    print(f"wrote {out}")
    if log.tau_unit == "A":
        print("tau is in A: later commands need --tau-unit A (or --drive-gains to make it a torque)")
