"""The paper, table by table."""

from __future__ import annotations

from typing import Any

from armloop.commands.arguments import Json
from armloop.commands.options import argument, option, required, within
from armloop.util.errors import InputError
from armloop.util.outputs import take_folder

HELP = "reproduce the paper's tables and figures, ours beside the paper's"
EXAMPLE = "armloop reproduce table2 fig9 --out out/reproduction"


class Reproduce(Json):
    """The options."""

    items: list[str] = argument(
        "ITEM",
        "fig1, table2, fig5, fig6, fig8, fig9, fig10, fig11, fig14, fig15 (default: all of these); beyond the paper "
        "estimators, conditions, coverage, friction",
        nargs="*",
    )
    out: str = required("folder for reproduction.json and report.html")
    draws: int = option(
        "noise draws per case; the paper shows one (%(default)s)",
        10,
        check=within(1, 1000, "give a number of draws from 1 to 1000"),
    )


def run(options: Reproduce) -> None:
    """Run the items, print and write what they come to."""
    import time
    from functools import partial

    from armloop.commands.shared import print_json, progress
    from armloop.reports.html import Section
    from armloop.util.checkpoints import Kept
    from armloop.util.files import write_json, write_text

    try:
        from armloop_paper import Context, chosen, run_item
        from armloop_paper.report import reproduction_report, terminal_text
    except ModuleNotFoundError as error:
        if error.name != "armloop_paper":
            raise
        raise InputError(
            "the package armloop_paper is not installed: reinstall armloop's wheel, which has it"
        ) from None

    names = chosen(options.items)
    folder = take_folder(options.out, ("reproduction.json", "report.html"))
    tell = progress(options)
    context = Context(draws=options.draws, progress=tell)
    kept = Kept(folder, {"draws": options.draws})
    answer, seconds, entries = {}, {}, []

    def item(name: str) -> dict[str, Any]:
        tell(f"{name} …")
        start = time.perf_counter()
        outcome = run_item(name, context)
        return {
            "answer": outcome.to_dict(),
            "headline": outcome.headline,
            "section": outcome.section.to_dict(),
            "seconds": time.perf_counter() - start,
        }

    for name in names:
        found = kept.once(name, partial(item, name))
        section, verdict = Section.from_dict(found["section"]), found["answer"]["verdict"]
        seconds[name], answer[name] = found["seconds"], found["answer"]
        entries.append((name, found["headline"], verdict, section))
        if not options.json:
            print(terminal_text(name, section, verdict, seconds[name]), flush=True)
    write_json(folder / "reproduction.json", answer)
    write_text(folder / "report.html", reproduction_report(entries, seconds))
    kept.clear()
    if options.json:
        print_json(answer)
    else:
        print(f"written: {folder}/reproduction.json, report.html  ({sum(seconds.values()):.0f} s)")
