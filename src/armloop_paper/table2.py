"""Table 2: SCARA, candidates, samples and time of one-shot SINDy and of the steps."""

from __future__ import annotations

from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper import paper
from armloop_paper.context import Context
from armloop_paper.experiments import SCARA
from armloop_paper.outcome import Outcome
from armloop_paper.timing import PARTS, counted, ratio


def run(context: Context) -> Outcome:
    """Count the candidates and time least squares in one run with one BLAS thread."""
    found = counted(context, SCARA, context.repeats)
    candidates, samples, steps, fewer = found.candidates, found.samples, found.stepwise, found.fewer
    ours_ratio, their_ratio, fast_ratio = map(ratio, (found.seconds, paper.SCARA_SECONDS, found.by_moments))
    ours = {
        "candidates": candidates,
        "orders": {part: list(orders) for part, orders in SCARA.orders.items()},
        "samples": samples,
        "seconds": found.seconds,
        "time_ratio": ours_ratio,
        "candidates_fewer_percent": round(fewer, 2),
        "time_less_percent": 100 * (1 - 1 / ours_ratio),
    }
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
            found.seconds[part],
            paper.SCARA_SECONDS[part],
            found.by_moments[part],
        ]
        for part in PARTS
    ]
    headers = ["", "(N1, N2)", "samples", "candidates", "paper", "lstsq [s]", "paper [s]", "moments [s]"]
    same = candidates == paper.SCARA_CANDIDATES and samples == paper.SCARA_SAMPLES
    text = [
        f"Candidates and samples {'are' if same else 'are not'} the paper's: {candidates['sindy']} against {steps} "
        f"for the three steps, {fewer:.2f} % fewer (paper {paper.SCARA_FEWER} %). The orders are the paper's.",
        "numpy.linalg.lstsq on the whole library, all joints at once, one BLAS thread: the steps together are "
        f"{ours_ratio:.1f} times faster (paper {their_ratio:.1f}). Seconds depend on the machine, the ratio less so. "
        f"As armloop solves it, by moments in angle sums and from the samples on, it is {fast_ratio:.1f}.",
    ]
    near = 0.5 < ours_ratio / their_ratio < 2.0
    return Outcome(
        theirs,
        ours,
        "agrees" if same and near else "partly" if same else "differs",
        f"{candidates['sindy']} against {steps} candidates (paper 360 against 168); steps {ours_ratio:.1f} times faster "
        f"(paper {their_ratio:.1f})",
        Section("Table 2, SCARA: candidates and time", text, tables=[make_table(headers, rows)]),
        {"seconds_by_moments": found.by_moments, "time_ratio_by_moments": fast_ratio},
    )
