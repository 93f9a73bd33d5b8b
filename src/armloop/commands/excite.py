"""Design an exciting reference and write it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from armloop.commands.arguments import ARM_HELP, Chain, Json, seed
from armloop.commands.options import argument, flag, option, required, within
from armloop.commands.ranges import Ranges, numbers, ranges, read_ranges
from armloop.util.outputs import take_file

if TYPE_CHECKING:
    from armloop.experiment.design import Settings
    from armloop.model import ReconstructedModel
    from armloop.robot.arm import Arm

HELP = "design an exciting reference within an arm's limits, optimised for the library that will be regressed"
EXAMPLE = "armloop excite three_axis --out reference.csv --compare --report reference.html"


class Excite(Ranges, Chain, Json):
    """The options."""

    arm: str = argument(help=ARM_HELP)
    out: str = required("the reference: time,q1..qn,v1..vn,vdot1..vdotn (SI units)", metavar="REF.csv")
    library: str | None = option(
        "what will be regressed: double-feature-set (default up to four joints) or rigid-body (default beyond)"
    )
    criterion: str = option(
        "what is optimised: variance (mean variance of the coefficients), logdet (log-determinant of the information) or "
        "condition (condition number of the regression) (%(default)s)",
        "variance",
    )
    duration: float | None = option("s (rigid-body 20, double-feature-set 60, at four joints 120)")
    base_frequency: float | None = option(
        "(default: one period is the duration, up to two minutes)", metavar="HZ"
    )
    harmonics: int | None = option("of the base frequency (default: as many as reach 0.4 Hz)")
    order: int = option("N1 of the double feature set's candidates (%(default)s)", 1)
    ranges: str | None = ranges("the plant of a built-in arm, else urdf")
    model: str | None = option(
        "predict the torque with this model, friction included, instead of the URDF's inertias",
        metavar="MODEL.json",
    )
    noise: str | None = option(
        "torque noise, N·m or N per joint (default: the model's baseline error, or 1 %% of the effort limit)",
        metavar="X1,..,XN",
    )
    starts: int | None = option(
        "of the optimiser (default: 4, from five joints on 3)", check=within(1, 1000, "give 1 to 1000")
    )
    random: int = option("random references to compare with (%(default)s)", 20)
    seed: int = option("(%(default)s)", 0, type=seed)
    rate: float = option(
        "rows per second of the file (%(default)s)",
        500.0,
        check=within(1, 1e4, "give 1 to 10000 rows per second"),
    )
    compare: bool = flag(
        "simulate noisy regressions: how much more data do random references need for the same coefficient error"
    )
    report: str | None = option("also write a report with plots", metavar="HTML")


def run(options: Excite) -> None:
    """Design an exciting reference and write it."""
    from armloop.commands.shared import arm_of, print_json, progress, take_reference
    from armloop.experiment.design import excite
    from armloop.experiment.excitation import write_reference
    from armloop.model import load_model
    from armloop.util.files import write_text
    from armloop.util.resources import urdf_names

    take_reference(options.out, "--out")
    take_file(options.report, "--report")
    arm = arm_of(options)
    model = load_model(options.model, arm) if options.model else None
    settings = settings_for(arm, model, numbers(options.noise, "--noise", arm), vars(options))
    settings.timing(arm.n)  # faults of the options before anything is computed
    whole = options.arm in urdf_names() and not options.lock and options.tip is None
    found = read_ranges(options, arm, options.arm if whole else "urdf")
    tell = progress(options)
    result = excite(arm, found, settings, model.of_the_drives().predict if model else None, tell)
    ratio = None
    if options.compare or options.report:
        tell("simulating noisy regressions on this reference and on random ones")
        ratio = result.compare()
    rows = write_reference(options.out, result.reference, options.rate)
    if options.report:
        from armloop.reports.excitation_report import excitation_report

        write_text(options.report, excitation_report(result, ratio))
    if options.json:
        compared = {} if ratio is None else {"data_ratio": ratio.to_dict()}
        print_json({"reference": str(options.out), "rows": rows, **result.to_dict(), **compared})
        return
    from armloop.reports.excitation_tables import measures_table, ratio_words, use_table
    from armloop.reports.words import wrapped

    print(measures_table(result))
    print()
    print(use_table(result))
    if ratio is not None:
        print(ratio_words(ratio, result))
    for note in result.notes:
        print(wrapped(f"note: {note}"))
    print(f"reference written to {options.out}, {rows} rows")


def settings_for(
    arm: Arm, model: ReconstructedModel | None, noise: tuple[float, ...] | None, chosen: Mapping[str, Any]
) -> Settings:
    """The design's settings, chosen by the options' names.

    Where none is given the library is the arm's usual one, and the noise what the model leaves on its own data.
    """
    from dataclasses import fields

    from armloop.experiment.design import Settings, baseline_noise
    from armloop.identification.reconstruction.reconstruct import default_conditioning, default_library

    library = chosen["library"] or default_library(arm)
    if noise is None and model is not None:
        noise = baseline_noise(model.baseline.get("rmse"))
    known = {field.name: chosen[field.name] for field in fields(Settings) if field.name in chosen}
    cutoff_hz = default_conditioning(library).cutoff_hz
    return Settings(**{**known, "library": library, "noise": noise, "cutoff_hz": cutoff_hz})
