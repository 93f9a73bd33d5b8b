"""Reconstruct with part of the logs left out, in turn, and score what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from armloop.commands.arguments import (
    ARM_HELP,
    CUTOFF,
    FRICTION,
    MAX_ORDER,
    METHOD,
    TORQUE_LAG,
    Chain,
    Json,
    Logs,
    Recorded,
    friction_laws,
    processes,
)
from armloop.commands.options import flag, option, positive, required
from armloop.util.errors import InputError
from armloop.util.outputs import take_folder

if TYPE_CHECKING:
    from armloop.identification.validation.crossvalidate import Fit

HELP = "reconstruct with each log, or alternating blocks, left out in turn, and score what was left out"
EXAMPLE = "armloop crossvalidate run1.csv run2.csv run3.csv --arm arm.urdf"


class Crossvalidate(Logs, Chain, Recorded, Json):
    """The options."""

    arm: str = required(ARM_HELP)
    leave_out: str | None = option(
        "each log in turn, or alternating blocks of every log, both halves in turn (default: file where there are two or "
        "more)",
        choices=("file", "blocks"),
    )
    block: float = option(
        "length of a block (%(default)s)",
        1.0,
        metavar="SECONDS",
        check=positive("give a positive number of seconds"),
    )
    method: str = METHOD
    library: str | None = option("as of armloop reconstruct (default: by number of joints)")
    cutoff: float | None = CUTOFF
    torque_lag: float | None = TORQUE_LAG
    friction: str | None = FRICTION
    max_order: int = MAX_ORDER
    no_physical: bool = flag(
        "do not keep M(q) positive definite and friction from driving", but_not="physical"
    )
    compare_physical: bool = flag(
        "do both, and insist on it as well, and say what physical consistency costs and gains",
        but_not="physical",
    )
    out: str | None = option(
        "folder for crossvalidation.json; each fit is kept there until the end, so that the same call goes on where it was "
        "ended"
    )
    jobs: int | None = processes("make the fits, which are the same for any number (default: one per core)")


def run(options: Crossvalidate) -> None:
    """Reconstruct with part of the logs left out, in turn, and score what was left out."""
    from armloop.commands.shared import (
        TORQUE,
        arm_of,
        print_json,
        progress,
        read_logs,
        recorded_as,
    )
    from armloop.data.signals import Conditioning
    from armloop.identification.reconstruction import Options
    from armloop.identification.validation import compare_physical, crossvalidate
    from armloop.reports.crossvalidation import (
        crossvalidation_tables,
        ladder_table,
        physical_table,
    )
    from armloop.reports.words import wrapped
    from armloop.util.checkpoints import Kept
    from armloop.util.files import write_json
    from armloop.util.workers import Processes

    if options.block != Crossvalidate.block and len(options.logs) > 1 and options.leave_out != "blocks":
        raise InputError(
            "--block is the length of blocks, but of several logs each is left out whole; add --leave-out blocks, or leave "
            "it out"
        )
    arm = arm_of(options)
    logs = read_logs(options.logs, arm, recorded_as(options, TORQUE))
    folder = None if options.out is None else take_folder(options.out, ("crossvalidation.json",))
    kept = Kept(folder, "crossvalidate")
    how: dict[str, Any] = {
        "leave_out": options.leave_out,
        "block_seconds": options.block,
        "method": options.method,
        "library": options.library,
        "conditioning": None if options.cutoff is None else Conditioning(cutoff_hz=options.cutoff),
        "options": Options(
            max_order=options.max_order,
            physical=not options.no_physical,
            friction=friction_laws(options.friction),
            torque_lag=options.torque_lag,
        ),
        "progress": progress(options),
        "kept": kept,
        "workers": Processes(options.jobs),
    }
    with kept.unless_at_fault():
        if options.compare_physical:
            comparison = compare_physical(logs, arm, **how)
            result = comparison.runs["physical"]
        else:
            comparison, result = None, crossvalidate(logs, arm, **how)
    compared = {} if comparison is None else {"physical_consistency": comparison.to_dict()}
    answer = {**result.to_dict(), **compared}
    if folder is not None:
        write_json(folder / "crossvalidation.json", {"schema": "armloop/crossvalidation/1", **answer})
        kept.clear()
    if options.json:
        print_json(answer)
        return
    for text in crossvalidation_tables(result):
        print(text, end="\n\n")
    ladder = ladder_table(result)
    if ladder is not None:
        print(ladder, end="\n\n")
    if comparison is not None:
        print(physical_table(comparison), end="\n\n")
    for line in notes_of(result.results):
        print(wrapped(line))


def notes_of(results: Sequence[tuple[str, Fit]]) -> list[str]:
    """What the reconstructions noted, each once, and of which of them it is said unless of all; a table has friction's."""
    without: dict[str, list[str]] = {}
    for name, fit in results:
        for note in dict.fromkeys(fit.notes):
            without.setdefault(note, []).append(name)
    return [
        f"note: {note}" if len(names) == len(results) else f"note (model without {', '.join(names)}): {note}"
        for note, names in without.items()
        if not note.startswith("friction, ")
    ]
