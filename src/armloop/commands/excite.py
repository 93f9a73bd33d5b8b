"""Design an exciting reference and write it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from armloop.commands.arguments import ARM_HELP, add_json, seed

if TYPE_CHECKING:
    from armloop.arm import Arm
    from armloop.excitation import MotionRanges

HELP = "design an exciting reference within an arm's limits, optimised for the library that will be regressed"
EXAMPLE = "armloop excite three_axis --out reference.csv --compare --report reference.html"


def arguments(p: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    p.add_argument("arm", help=ARM_HELP)
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
    p.add_argument(
        "--ranges",
        default=None,
        metavar="PLANT",
        help="take the ranges of motion from this plant of scenarios/plants.yaml, or `urdf`: nine tenths of the travel and "
        "half the speed of the URDF's limits (default: the plant of a built-in arm, else urdf)",
    )
    for name, unit in (("lower", "rad or m"), ("upper", "rad or m"), ("velocity", "rad/s or m/s")):
        p.add_argument(
            f"--{name}",
            default=None,
            metavar="X1,..,XN",
            help=f"{unit} per joint; write --{name}=-1,2 if negative",
        )
    p.add_argument(
        "--acceleration",
        default=None,
        metavar="X1,..,XN",
        help="rad/s² or m/s² per joint (without a plant: twice the velocity)",
    )
    p.add_argument(
        "--reserve",
        type=float,
        default=0.2,
        help="part of the URDF's effort limits that is kept free (%(default)s)",
    )
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
    from armloop.arm import load_arm
    from armloop.commands.shared import out_file, print_json, progress
    from armloop.design import Settings, excite
    from armloop.errors import InputError
    from armloop.excitation import write_reference
    from armloop.files import write_text
    from armloop.model import load_model
    from armloop.reconstruction.reconstruct import default_conditioning, default_library
    from armloop.tables import CSV, PARQUET

    for name in ("out", "report"):
        out_file(getattr(options, name), f"--{name}")
    if not options.out.endswith((CSV, PARQUET)):
        raise InputError(f"--out {options.out}: a reference ends in {CSV} or {PARQUET}")
    if not 1 <= options.rate <= 1e4:
        raise InputError(f"--rate {options.rate:g}: give 1 to 10000 rows per second")
    if options.starts is not None and not 1 <= options.starts <= 1000:
        raise InputError(f"--starts {options.starts}: give 1 to 1000")
    arm = load_arm(options.arm)
    library = options.library or default_library(arm)
    model = load_model(options.model, arm) if options.model else None
    noise = _numbers(options.noise, "--noise", arm)
    if noise is None and model is not None:
        noise = _baseline_noise(model.baseline.get("rmse"))
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
    ranges = _ranges(options, arm)
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


def _ranges(options: argparse.Namespace, arm: Arm) -> MotionRanges:
    """The ranges of a plant or of the URDF, with what the options say instead."""
    from armloop.errors import InputError
    from armloop.excitation import ranges_with
    from armloop.resources import urdf_names

    name = options.ranges or (options.arm if options.arm in urdf_names() else "urdf")
    stated = {
        key: _numbers(getattr(options, key), f"--{key}", arm)
        for key in ("lower", "upper", "velocity", "acceleration")
    }
    if name == "urdf":
        return ranges_with(arm, None, **stated)
    from armloop.drake_systems.scenarios import load_plant

    plant = load_plant(name)
    if plant.arm.n != arm.n:
        raise InputError(f"--ranges {name}: of an arm with {plant.arm.n} joints; {arm.name} has {arm.n}")
    return ranges_with(arm, plant.config.ranges, **stated)


def _numbers(text: str | None, option: str, arm: Arm) -> tuple[float, ...] | None:
    """One finite number per joint."""
    from math import isfinite

    from armloop.errors import InputError

    if text is None:
        return None
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"{option} {text!r}: give one number per joint, separated by commas") from error
    if len(values) != arm.n or not all(map(isfinite, values)):
        raise InputError(f"{option} {text!r}: give {arm.n} numbers, one per joint of {arm.name}")
    return values


def _baseline_noise(rmse: list[float | None] | None) -> tuple[float, ...] | None:
    """What a model leaves on its own data, as noise; None where it does not say for every joint."""
    if not rmse or not all(rmse):
        return None
    return tuple(float(x) for x in rmse if x)
