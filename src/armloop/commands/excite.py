"""Design an exciting reference and write it."""

from __future__ import annotations

import argparse

from armloop.commands.arguments import ARM_HELP, add_chain, add_json, seed
from armloop.commands.ranges import add_ranges, numbers, read_ranges

HELP = "design an exciting reference within an arm's limits, optimised for the library that will be regressed"
EXAMPLE = "armloop excite three_axis --out reference.csv --compare --report reference.html"


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    p.add_argument("arm", help=ARM_HELP)
    add_chain(p)
    p.add_argument(
        "--out",
        required=True,
        metavar="REF.csv",
        help="the reference: time,q1..qn,v1..vn,vdot1..vdotn (SI units)",
    )
    p.add_argument(
        "--library",
        default=None,
        help="what will be regressed: double-feature-set (default up to four joints) or rigid-body (default beyond)",
    )
    p.add_argument(
        "--criterion",
        default="variance",
        help="what is optimised: variance (mean variance of the coefficients), logdet (log-determinant of the "
        "information) or condition (condition number of the regression) (%(default)s)",
    )
    p.add_argument(
        "--duration",
        type=float,
        default=None,
        help="s (rigid-body 20, double-feature-set 60, at four joints 120)",
    )
    p.add_argument(
        "--base-frequency",
        type=float,
        default=None,
        metavar="HZ",
        help="(default: one period is the duration, up to two minutes)",
    )
    p.add_argument(
        "--harmonics", type=int, default=None, help="of the base frequency (default: as many as reach 0.4 Hz)"
    )
    p.add_argument(
        "--order", type=int, default=1, help="N1 of the double feature set's candidates (%(default)s)"
    )
    add_ranges(p, "the plant of a built-in arm, else urdf", "without a plant: twice the velocity")
    p.add_argument(
        "--model",
        default=None,
        metavar="MODEL.json",
        help="predict the torque with this model, friction included, instead of the URDF's inertias",
    )
    p.add_argument(
        "--noise",
        default=None,
        metavar="X1,..,XN",
        help="torque noise, N·m or N per joint (default: the model's baseline error, or 1 %% of the effort limit)",
    )
    p.add_argument(
        "--starts", type=int, default=None, help="of the optimiser (default: 4, from five joints on 3)"
    )
    p.add_argument("--random", type=int, default=20, help="random references to compare with (%(default)s)")
    p.add_argument("--seed", type=seed, default=0, help="(%(default)s)")
    p.add_argument("--rate", type=float, default=500.0, help="rows per second of the file (%(default)s)")
    p.add_argument(
        "--compare",
        action="store_true",
        help="simulate noisy regressions: how much more data do random references need for the same coefficient error",
    )
    p.add_argument("--report", default=None, metavar="HTML", help="also write a report with plots")
    add_json(p)


def run(options: argparse.Namespace) -> None:
    """Design an exciting reference and write it."""
    from armloop.commands.shared import arm_of, out_file, print_json, progress
    from armloop.data.tables import CSV, PARQUET
    from armloop.experiment.design import Settings, baseline_noise, excite
    from armloop.experiment.excitation import write_reference
    from armloop.identification.reconstruction.reconstruct import default_conditioning, default_library
    from armloop.model import load_model
    from armloop.util.errors import InputError
    from armloop.util.files import write_text
    from armloop.util.resources import urdf_names

    for name in ("out", "report"):
        out_file(getattr(options, name), f"--{name}")
    if not options.out.endswith((CSV, PARQUET)):
        raise InputError(f"--out {options.out}: a reference ends in {CSV} or {PARQUET}")
    if not 1 <= options.rate <= 1e4:
        raise InputError(f"--rate {options.rate:g}: give 1 to 10000 rows per second")
    if options.starts is not None and not 1 <= options.starts <= 1000:
        raise InputError(f"--starts {options.starts}: give 1 to 1000")
    arm = arm_of(options)
    library = options.library or default_library(arm)
    model = load_model(options.model, arm) if options.model else None
    noise = numbers(options.noise, "--noise", arm)
    if noise is None and model is not None:
        noise = baseline_noise(model.baseline.get("rmse"))
    settings = Settings(
        library=library,
        criterion=options.criterion,
        duration=options.duration,
        base_frequency=options.base_frequency,
        harmonics=options.harmonics,
        order=options.order,
        reserve=options.reserve,
        noise=noise,
        cutoff_hz=default_conditioning(library).cutoff_hz,
        starts=options.starts,
        seed=options.seed,
        random=options.random,
    )
    settings.timing(arm.n)  # faults of the options before anything is computed
    whole = options.arm in urdf_names() and not options.lock and options.tip is None
    ranges = read_ranges(options, arm, options.arm if whole else "urdf")
    tell = progress(options)
    result = excite(arm, ranges, settings, model.predict if model else None, tell)
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

    print(measures_table(result))
    print()
    print(use_table(result))
    if ratio is not None:
        print(ratio_words(ratio, result))
    for note in result.notes:
        print(f"note: {note}")
    print(f"reference written to {options.out}, {rows} rows")
