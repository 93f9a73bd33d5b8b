"""Turn logs of other programs into a motion log."""

from __future__ import annotations

from armloop.commands.arguments import ARM_HELP, Chain, Json, drive_gains, tau_unit
from armloop.commands.options import argument, flag, option

HELP = (
    "turn other programs' logs (ROS bags, RTDE, libfranka, LeRobot, .mat, .npz, any table) into a motion log"
)
EXAMPLE = (
    "armloop convert bag_folder --arm ur10e.urdf --tau-unit N*m --out run.parquet\n"
    "  armloop convert rtde.csv --drive-gains 12.5,12.5,12.5,9.2,9.2,9.2 --out run.parquet\n"
    "  armloop convert table.csv --suggest --map map.yaml     then complete map.yaml, and\n"
    "  armloop convert table.csv --map map.yaml --out run.parquet"
)


class Convert(Chain, Json):
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
    from pathlib import Path

    from armloop.commands.shared import CURRENTS_ONLY, drive_gains, out_file, print_json, stated_arm
    from armloop.convert import Answers, convert, read_map
    from armloop.data.log import said_of_log
    from armloop.data.tables import CSV, PARQUET, kind_of, write_columns
    from armloop.util.errors import InputError

    arm = stated_arm(options)
    if options.drive_gains is not None and options.tau_unit == "N*m":
        raise InputError(CURRENTS_ONLY)
    if options.suggest:
        _suggest(options, arm)
        return
    if options.out is None:
        raise InputError("convert: --out is missing; give the log to write, such as --out run.parquet")
    out = Path(options.out)
    out_file(options.out, "--out")
    if kind_of(out) not in (CSV, PARQUET):
        raise InputError(f"{out}: unknown suffix {out.suffix!r}; --out must end in .parquet or .csv")
    mapping = read_map(options.map) if options.map else None
    answers = Answers(options.tau_unit, drive_gains(options.drive_gains), options.angle_unit)
    found = convert(options.sources, arm=arm, mapping=mapping, answers=answers, topic=options.topic)
    write_columns(out, found.columns(), said_of_log(found.log))
    if options.json:
        print_json(_answer(found, out))
        return
    _tell(found, out, arm)


def _suggest(options: Convert, arm: object) -> None:
    from pathlib import Path

    from armloop.commands.shared import out_file, print_json
    from armloop.convert import doubts, read_sources, suggested, written
    from armloop.util.errors import InputError
    from armloop.util.files import write_text

    out = None if options.out is None else Path(options.out)
    if options.map is not None:
        place: Path | None = Path(options.map)
    elif out is not None:
        place = out if out.suffix in (".yaml", ".yml") else out.with_suffix(".map.yaml")
    else:
        place = None
    if place is not None:
        if place.exists() and not options.force:
            raise InputError(
                f"{place}: exists; --suggest writes a new map, give another name with --map, or add --force"
            )
        out_file(str(place), "--map")
    recording = read_sources(options.sources[:1], arm, options.topic)[0]  # type: ignore[arg-type]
    mapping, unsure = suggested(recording, arm)  # type: ignore[arg-type]
    text = written(mapping, unsure, recording)
    if place is not None:
        write_text(place, text)
    known = "?" not in mapping.q.names()
    if options.json:
        answer = {"map": None if place is None else str(place), "kind": recording.kind}
        print_json(
            {
                **answer,
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


def _answer(found: object, out: object) -> dict[str, object]:
    from armloop.convert import Converted

    assert isinstance(found, Converted)
    log = found.log
    return {
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


def _tell(found: object, out: object, arm: object) -> None:
    import numpy as np

    from armloop.convert import Converted
    from armloop.reports.tables import table
    from armloop.robot.arm import Arm

    assert isinstance(found, Converted) and isinstance(arm, Arm | None)
    log = found.log
    seconds = sum(float(log.time[run.stop - 1] - log.time[run.start]) for run in log.runs())
    runs = log.runs()
    print(
        f"{', '.join(dict.fromkeys(found.kinds))}: {log.samples} samples at {1 / log.period:.4g} Hz, {seconds:.4g} s, "
        f"{len(runs)} run{'s' if len(runs) > 1 else ''}"
    )
    rows = []
    for j in range(log.joints):
        name = "" if arm is None else arm.joints[j].name
        reach = f"{log.q[:, j].min():.4g} … {log.q[:, j].max():.4g}"
        rows.append(
            [
                j + 1,
                name,
                found.joints[j],
                reach,
                f"{np.abs(log.v[:, j]).max():.4g}",
                f"{np.abs(log.tau[:, j]).max():.4g}",
            ]
        )
    unit = "A" if log.tau_unit == "A" else "N·m"
    print(
        table(["joint", "arm", "source", "q, rad (m)", "largest |v|, rad/s", f"largest |tau|, {unit}"], rows)
    )
    for note in found.notes:
        print(f"  {note}")
    if found.extra:
        print(f"  kept beside it: {', '.join(list(found.extra)[:12])}{' …' if len(found.extra) > 12 else ''}")
    print(f"wrote {out}")
    if log.tau_unit == "A":
        print("tau is in A: later commands need --tau-unit A (or --drive-gains to make it a torque)")
