"""Reconstruct with part of the logs left out, in turn, and score what was left out."""

from __future__ import annotations

import argparse

from armloop.commands.arguments import ARM_HELP, add_chain, add_jobs, add_json, add_logs, add_recorded

HELP = "reconstruct with each log, or alternating blocks, left out in turn, and score what was left out"
EXAMPLE = "armloop crossvalidate run1.csv run2.csv run3.csv --arm arm.urdf"


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_logs(p)
    p.add_argument("--arm", required=True, help=ARM_HELP)
    add_chain(p)
    p.add_argument(
        "--leave-out",
        choices=("file", "blocks"),
        default=None,
        help="each log in turn, or alternating blocks of every log, both halves in turn (default: file where there "
        "are two or more)",
    )
    p.add_argument(
        "--block", type=float, default=1.0, metavar="SECONDS", help="length of a block (%(default)s)"
    )
    p.add_argument(
        "--method",
        default="stepwise",
        help="stepwise, or sindy: one regression of everything, the reference method (%(default)s)",
    )
    p.add_argument("--library", default=None, help="as of armloop reconstruct (default: by number of joints)")
    p.add_argument(
        "--cutoff",
        type=float,
        default=None,
        help="low-pass in Hz, 0 for none (default: by held-out error, at most 10)",
    )
    p.add_argument("--max-order", type=int, default=4, help="largest truncation order N1 tried (%(default)s)")
    choice = p.add_mutually_exclusive_group()
    choice.add_argument(
        "--no-physical",
        action="store_true",
        help="do not keep M(q) positive definite and friction from driving",
    )
    choice.add_argument(
        "--compare-physical",
        action="store_true",
        help="do both, and insist on it as well, and say what physical consistency costs and gains",
    )
    p.add_argument(
        "--out",
        default=None,
        help="folder for crossvalidation.json; each fit is kept there until the end, so that the same call goes on where "
        "it was ended",
    )
    add_jobs(p, "make the fits, which are the same for any number (default: one per core)")
    add_recorded(p, "N*m")
    add_json(p)


def run(options: argparse.Namespace) -> None:
    """Reconstruct with part of the logs left out, in turn, and score what was left out."""
    from armloop.commands.shared import (
        TORQUE,
        arm_of,
        out_folder,
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
    from armloop.util.checkpoints import Kept
    from armloop.util.errors import InputError
    from armloop.util.files import write_json
    from armloop.util.workers import Processes

    if not 0 < options.block < float("inf"):
        raise InputError(f"--block {options.block}: give a positive number of seconds")
    if not 1 <= options.max_order <= 6:
        raise InputError(f"--max-order {options.max_order}: give an order from 1 to 6")
    if options.cutoff is not None and not 0 <= options.cutoff < 1e4:
        raise InputError(f"--cutoff {options.cutoff}: give a frequency in Hz, or 0 for no filter")
    arm = arm_of(options)
    logs = read_logs(options.logs, arm.n, recorded_as(options, TORQUE))
    folder = None if options.out is None else out_folder(options.out, ("crossvalidation.json",))
    kept = Kept(folder, "crossvalidate")
    how = {
        "leave_out": options.leave_out,
        "block_seconds": options.block,
        "method": options.method,
        "library": options.library,
        "conditioning": None if options.cutoff is None else Conditioning(cutoff_hz=options.cutoff),
        "options": Options(max_order=options.max_order, physical=not options.no_physical),
        "progress": progress(options),
        "kept": kept,
        "workers": Processes(options.jobs),
    }
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
    for note in dict.fromkeys(note for _, fit in result.results for note in fit.notes):
        if not note.startswith("friction, "):  # the table has them all
            print(f"note: {note}")
