"""Fig. 9: three-axis arm, numbers of candidates and time of regression."""

from __future__ import annotations

from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper import paper
from armloop_paper.context import Context
from armloop_paper.experiments import STEPS, THREE_AXIS
from armloop_paper.outcome import Outcome
from armloop_paper.timing import PARTS, counted, ratio


def run(context: Context) -> Outcome:
    """Count the candidates; time one lstsq of 21,000 × 5,880 and those of the steps in the same run."""
    found = counted(context, THREE_AXIS, 1)
    times, moments = found.seconds, found.by_moments
    candidates, samples, steps, fewer = found.candidates, found.samples, found.stepwise, found.fewer
    seconds = {"sindy": times["sindy"], "stepwise": sum(times[step] for step in STEPS)}
    ours_ratio, fast_ratio = ratio(times), ratio(moments)
    their_ratio = paper.THREE_AXIS_SECONDS["sindy"] / paper.THREE_AXIS_SECONDS["stepwise"]
    ours = {
        "candidates": candidates,
        "candidates_stepwise": steps,
        "candidates_fewer_percent": round(fewer, 2),
        "samples": samples,
        "seconds": seconds,
        "time_ratio": ours_ratio,
        "time_less_percent": 100 * (1 - 1 / ours_ratio),
    }
    theirs = {
        "candidates": paper.THREE_AXIS_CANDIDATES,
        "candidates_stepwise": paper.THREE_AXIS_STEPWISE,
        "candidates_fewer_percent": paper.THREE_AXIS_FEWER,
        "samples": paper.THREE_AXIS_SAMPLES,
        "seconds": paper.THREE_AXIS_SECONDS,
        "time_ratio": their_ratio,
        "time_less_percent": paper.THREE_AXIS_FASTER,
    }
    independent = {part: THREE_AXIS.library(part, independent=True).size for part in PARTS}
    rows: list[list[object]] = [
        [
            part,
            samples[part],
            candidates[part],
            paper.THREE_AXIS_CANDIDATES[part],
            independent[part],
            times[part],
            moments[part],
        ]
        for part in PARTS
    ]
    headers = ["", "samples", "candidates", "paper", "independent", "lstsq [s]", "moments [s]"]
    totals: list[list[object]] = [
        ["one-shot", seconds["sindy"], paper.THREE_AXIS_SECONDS["sindy"]],
        ["stepwise", seconds["stepwise"], paper.THREE_AXIS_SECONDS["stepwise"]],
        ["ratio", ours_ratio, their_ratio],
        ["ratio by moments", fast_ratio, None],
    ]
    same = candidates == paper.THREE_AXIS_CANDIDATES and samples == paper.THREE_AXIS_SAMPLES
    near = 0.5 < ours_ratio / their_ratio < 2
    text = [
        f"Candidates {'are' if same else 'are not'} the paper's: {candidates['sindy']} against {steps}, {fewer:.2f} "
        f"% fewer (paper {paper.THREE_AXIS_FEWER} %). sin² + cos² = 1 makes many of them redundant: "
        f"{independent['sindy']} of the {candidates['sindy']} are independent.",
        f"A single numpy.linalg.lstsq of all joints with one BLAS thread takes {seconds['sindy']:.0f} s at once and "
        f"{seconds['stepwise']:.1f} s in steps: {ours_ratio:.1f} times less (paper {their_ratio:.1f}).",
        "As armloop solves the same, by moments in angle sums, from the samples on and to the same accuracy, it "
        f"takes {moments['sindy']:.1f} s at once, {times['sindy'] / moments['sindy']:.0f} times less than lstsq; "
        f"then the steps save only {fast_ratio:.1f} times. The stepwise method's gain in time is mostly that of a "
        "slow solver.",
    ]
    return Outcome(
        theirs,
        ours,
        "agrees" if same and near else "partly" if same else "differs",
        f"{candidates['sindy']} against {steps} candidates (paper 5880 against 2968); steps {ours_ratio:.1f} times faster "
        f"(paper {their_ratio:.1f})",
        Section(
            "Figure 9, three axes: candidates and time",
            text,
            tables=[
                make_table(headers, rows),
                make_table(["least squares", "ours [s]", "paper [s]"], totals),
            ],
        ),
        {
            "seconds_lstsq": times,
            "seconds_by_moments": moments,
            "time_ratio_by_moments": fast_ratio,
            "independent": independent,
        },
    )
