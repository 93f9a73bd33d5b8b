"""Reconstruct a model and write it."""

from __future__ import annotations

import math

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
from armloop.util.outputs import take_file

HELP = "reconstruct a readable model of the joint torques from logs"
EXAMPLE = "armloop reconstruct out/logs/*.csv --arm three_axis --out model.json"


class Reconstruct(Logs, Chain, Recorded, Json):
    """The options."""

    arm: str = required(ARM_HELP)
    out: str = required("the model file, JSON")
    method: str = METHOD
    library: str | None = option(
        "double-feature-set (the paper's, up to four joints), rigid-body (base parameters of the URDF's chain) or "
        "lagrangian (few terms of the energies, found without the URDF's lengths); default: all of them, and of those that "
        "pass the checks of physics the best on blocks held out for this choice"
    )
    estimator: str = option(
        "how terms are chosen: evidence (Lasso path, information criterion, exchange of terms), lasso, debiased_lasso, "
        "adaptive_lasso, thresholded, stlsq, sr3, stability or least_squares (%(default)s)",
        "evidence",
    )
    penalty: float | None = option(
        "λ of the Lassos (Eq. 32), or the threshold of thresholded, stlsq and sr3, for columns and torque of unit root mean "
        "square (default: by held-out error)",
        check=positive("λ must be positive"),
    )
    snr: str | None = option(
        "signal-to-noise ratios in dB of q, v and vdot, where they are known and the samples are no time series (--cutoff "
        "0): coefficients are corrected for this noise after the terms are chosen",
        metavar="Q,V,VDOT",
    )
    max_order: int = MAX_ORDER
    cutoff: float | None = CUTOFF
    torque_lag: float | None = TORQUE_LAG
    coefficients: bool = flag("print every coefficient with its standard error, too")
    friction: str | None = FRICTION
    no_physical: bool = flag(
        "do not keep M(q) positive definite and friction from driving (rigid-body and lagrangian)"
    )
    jobs: int | None = processes(
        "pass over logs of more than 500,000 samples, which are read piece by piece (default: one per core)"
    )
    scheduler: str | None = option(
        "pass over the logs on a Dask cluster whose workers see the same files (extra: dask)",
        metavar="ADDRESS",
    )
    report: str | None = option("also write a report with plots", metavar="HTML")


def run(options: Reconstruct) -> None:
    """Reconstruct a model and write it."""
    from armloop.commands.shared import (
        TORQUE,
        arm_of,
        check_columns,
        print_json,
        progress,
        recorded_as,
    )
    from armloop.data.pieces import IN_MEMORY, first_samples, log_sources
    from armloop.data.signals import Conditioning
    from armloop.identification.goodness import unjudged
    from armloop.identification.reconstruction import Options
    from armloop.identification.reconstruction import reconstruct as run
    from armloop.regression.sparse import Sparse
    from armloop.reports.tables import (
        compared,
        formulas,
        libraries_table,
        parts_table,
        score_table,
        steps_table,
    )
    from armloop.reports.words import wrapped
    from armloop.util.doubts import warn
    from armloop.util.files import write_text
    from armloop.util.workers import Cluster, Processes

    sparse, snr = Sparse(options.estimator, options.penalty), _snr(options)
    take_file(options.out, "--out")
    take_file(options.report, "--report")
    arm = arm_of(options)
    check_columns(options.logs, arm)
    recorded = recorded_as(options, TORQUE)
    most = 0 if options.scheduler else IN_MEMORY
    logs = log_sources(options.logs, arm.n, recorded, most)
    if (options.jobs or 1) > 1 and sum(log.samples for log in logs) <= most:
        warn(f"--jobs is not used: logs of up to {most:,} samples are kept in memory and regressed at once")
    workers = Cluster(options.scheduler) if options.scheduler else Processes(options.jobs)
    try:
        result = run(
            logs,
            arm,
            options.method,
            options.library,
            None if options.cutoff is None else Conditioning(cutoff_hz=options.cutoff),
            Options(
                sparse=sparse,
                max_order=options.max_order,
                physical=not options.no_physical,
                snr=snr,
                friction=friction_laws(options.friction),
                torque_lag=options.torque_lag,
            ),
            progress(options),
            recorded,
            workers,
            in_memory=most,
        )
    finally:
        workers.close()
    result.model.save(options.out)
    if options.report:
        from armloop.reports.reconstruction_report import reconstruction_report

        progress(options)("drawing the report")
        write_text(options.report, reconstruction_report(result, first_samples(logs)))
    if options.json:
        print_json({"model": str(options.out), **result.to_dict()})
        return
    for warning in result.warnings:
        print(f"WARNING: {warning}")
    if compared(result.libraries):
        print(libraries_table(result.libraries), end="\n\n")
    print(steps_table(result.reports))
    print()
    print(formulas(result.model), *result.model.legend(), sep="\n")
    print()
    if options.coefficients:
        from armloop.reports.coefficients import NOTE, coefficients_table, stribeck_table

        for table in (coefficients_table(result.model), stribeck_table(result.model)):
            print(table, end="\n\n") if table else None
        print(wrapped(NOTE), end="\n\n")
    units = result.model.torque_units
    print(score_table(result.held_out, arm, "Prediction error on held-out blocks", units), end="\n\n")
    print(parts_table(result.parts, arm))
    for note in [*unjudged(result.parts), *result.notes]:
        print(wrapped(f"note: {note}"))
    print(f"model written to {options.out}")


def _snr(options: Reconstruct) -> tuple[float, float, float] | None:
    """The signal-to-noise ratios of q, v and vdot, or None."""
    if options.snr is None:
        return None
    try:
        q, v, vdot = (float(level) for level in options.snr.split(","))
    except ValueError:
        raise InputError(f"--snr {options.snr}: give three numbers in dB, such as 60,40,20") from None
    if not all(0 < level < math.inf for level in (q, v, vdot)):
        raise InputError(f"--snr {options.snr}: ratios in dB must be positive")
    require_ratios_used("--snr", "--cutoff 0", options.method, options.library, options.cutoff)
    return q, v, vdot


def require_ratios_used(
    snr: str, unfiltered: str, method: str, library: str | None, cutoff: float | None
) -> None:
    """Raise ``InputError``, by the names that the options have, where signal-to-noise ratios would not be looked at."""
    if cutoff != 0:
        raise InputError(f"{snr} is for samples that are no time series; give {unfiltered} with it")
    if method != "stepwise" or library not in (None, "double-feature-set"):
        raise InputError(f"{snr} works with the stepwise method and the library double-feature-set")
