"""Table 2: SCARA, candidates, samples and time of one-shot SINDy and of the steps."""

from __future__ import annotations

from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper import paper
from armloop_paper.context import Context
from armloop_paper.experiments import SCARA, STEPS
from armloop_paper.outcome import Outcome
from armloop_paper.timing import lstsq_times, moment_times


def run(context: Context) -> Outcome:
    """Count the candidates and time least squares in one run with one BLAS thread."""
    [times] = context.map(lstsq_times, [("scara", context.repeats)], "least squares")
    [moments] = context.map(moment_times, [("scara", context.repeats)], "the same by moments")
    candidates = {part: SCARA.library(part).size for part in ("sindy", *STEPS)}
    samples = {"sindy": sum(SCARA.counts), **dict(zip(STEPS, SCARA.counts, strict=True))}
    steps = sum(candidates[step] for step in STEPS)
    fewer = 100 * (1 - steps / candidates["sindy"])
    ratio = times["sindy"] / sum(times[step] for step in STEPS)
    fast_ratio = moments["sindy"] / sum(moments[step] for step in STEPS)
    ours = {
        "candidates": candidates,
        "orders": {part: list(orders) for part, orders in SCARA.orders.items()},
        "samples": samples,
        "seconds": times,
        "time_ratio": ratio,
        "candidates_fewer_percent": round(fewer, 2),
        "time_less_percent": 100 * (1 - 1 / ratio),
    }
    their_ratio = paper.SCARA_SECONDS["sindy"] / sum(paper.SCARA_SECONDS[step] for step in STEPS)
    theirs = {
        "candidates": paper.SCARA_CANDIDATES,
        "orders": paper.SCARA_ORDERS,
        "samples": paper.SCARA_SAMPLES,
        "seconds": paper.SCARA_SECONDS,
        "time_ratio": their_ratio,
        "candidates_fewer_percent": paper.SCARA_FEWER,
        "time_less_percent": paper.SCARA_FASTER,
    }
    rows = [
        [
            part,
            "({}, {})".format(*SCARA.orders[part]),
            samples[part],
            candidates[part],
            paper.SCARA_CANDIDATES[part],
            times[part],
            paper.SCARA_SECONDS[part],
            moments[part],
        ]
        for part in ("sindy", *STEPS)
    ]
    headers = ["", "(N1, N2)", "samples", "candidates", "paper", "lstsq [s]", "paper [s]", "moments [s]"]
    same = candidates == paper.SCARA_CANDIDATES and samples == paper.SCARA_SAMPLES
    text = [
        f"Candidates and samples {'are' if same else 'are not'} the paper's: {candidates['sindy']} against {steps} "
        f"for the three steps, {fewer:.2f} % fewer (paper {paper.SCARA_FEWER} %). The orders are the paper's.",
        "numpy.linalg.lstsq on the whole library, all joints at once, one BLAS thread: the steps together are "
        f"{ratio:.1f} times faster (paper {their_ratio:.1f}). Seconds depend on the machine, the ratio less so. "
        f"As armloop solves it, by moments in angle sums and from the samples on, it is {fast_ratio:.1f}.",
    ]
    near = 0.5 < ratio / their_ratio < 2.0
    return Outcome(
        theirs,
        ours,
        "agrees" if same and near else "partly" if same else "differs",
        f"{candidates['sindy']} against {steps} candidates (paper 360 against 168); steps {ratio:.1f} times faster "
        f"(paper {their_ratio:.1f})",
        Section("Table 2, SCARA: candidates and time", text, tables=[make_table(headers, rows)]),
        {"seconds_by_moments": moments, "time_ratio_by_moments": fast_ratio},
    )
