"""Fig. 1: the indicator, its clusters, the elbow, and the iterations of Algorithm 1 from random starts."""

from __future__ import annotations

import numpy as np
from sklearn.metrics import adjusted_rand_score

from armloop.data.motion import Motion
from armloop.data.regimes import algorithm_1, sort_samples
from armloop.reports.html import Picture, Section
from armloop.reports.plots import clusters_figure
from armloop.reports.tables import make_table
from armloop_paper import paper
from armloop_paper.context import Context
from armloop_paper.experiments import SCARA
from armloop_paper.outcome import Outcome
from armloop_paper.sorting_motion import sorting_motion
from armloop_paper.spread import in_words

#: Shares of Table 1's velocities that the sorting motion uses; the paper does not say how fast its arm moves.
_PACES = (0.1, 0.3, 1.0)
_PACE = 0.3
#: What a row of the table has of each trial, and with how many digits.
_SHOWN = {
    "elbow": 3,
    "iterations_max": 3,
    "iterations_mean": 3,
    "iterations_mean_from_box": 3,
    "rand_paper": 2,
    "rand_robust": 2,
}


def run(context: Context) -> Outcome:
    """Sort a noisy sorting motion; count iterations over random starts; compare with the truth."""
    jobs = [(pace, seed, context.starts) for pace in _PACES for seed in range(context.draws)]
    trials = context.map(_trial, jobs, "sorting motions")
    rows: list[list[object]] = []
    details: dict[str, dict[str, list[float]]] = {}
    for k, pace in enumerate(_PACES):
        own = trials[k * context.draws : (k + 1) * context.draws]
        found = details[f"{pace:g}"] = {key: [trial[key] for trial in own] for key in own[0]}
        rows.append([f"{pace:.0%}", *(in_words(found[key], digits) for key, digits in _SHOWN.items())])
    mine = details[f"{_PACE:g}"]
    ours = {
        "clusters": int(np.median(mine["elbow"])),
        "random_starts": context.starts,
        "iterations_max": int(np.median(mine["iterations_max"])),
        "iterations_mean": float(np.median(mine["iterations_mean"])),
    }
    theirs = {
        "clusters": paper.CLUSTERS,
        "random_starts": paper.RUNS,
        "iterations_max": paper.ITERATIONS_MAX,
        "iterations_mean": paper.ITERATIONS_MEAN,
    }
    rows.append(["paper", "3", "12", "5.75", None, None, None])
    same = ours["clusters"] == paper.CLUSTERS
    near = (
        0.5 < ours["iterations_mean"] / paper.ITERATIONS_MEAN < 2
        and ours["iterations_max"] < 2 * paper.ITERATIONS_MAX
    )
    h, first, second = paper.INDICATOR
    right = {pace: float(np.median(details[f"{pace:g}"]["rand_paper"])) for pace in _PACES}
    bends = {pace: int(np.median(details[f"{pace:g}"]["elbow"])) for pace in _PACES}
    text = [
        "A SCARA arm moves from place to place with trapezoidal velocities and rests in between; noise of "
        f"{paper.SORTING_SNR[0]:.0f} and {paper.SORTING_SNR[1]:.0f} dB in velocities and accelerations; h = {h:g}, "
        f"W₁ = {first}, W₂ = {second}. {context.draws} motions, {context.starts} random starts each (samples as "
        "first centres; for the fifth column points of the box around them). The paper does not say how fast its "
        f"arm moves; the figures beside it are those at {_PACE:.0%} of the velocities of Table 1.",
        f"The elbow {'is at three clusters, as in the paper' if same else 'is not at three clusters'}, and Algorithm "
        f"1 takes {ours['iterations_mean']:.2f} iterations on average and {ours['iterations_max']} at most (paper "
        f"{paper.ITERATIONS_MEAN} and {paper.ITERATIONS_MAX}).",
        "The elbow depends on the speed: it is at "
        + ", ".join(f"{bends[pace]} clusters at {pace:.0%}" for pace in _PACES)
        + ".",
        "But neither the elbow nor the iterations say that the clusters are right. Against the true conditions the "
        "adjusted Rand index of the paper's indicator is "
        + ", ".join(f"{right[pace]:.2f} at {pace:.0%}" for pace in _PACES)
        + f" of the speed, that of armloop's {np.median(mine['rand_robust']):.2f} at {_PACE:.0%} "
        "(1 is perfect, 0 is chance). With h = 60 the switch saturates on the noise of standing still, and the sign "
        "in Eq. (5) splits what belongs together.",
    ]
    shown = sort_samples(_noisy(_PACE, 0)[0], "paper")
    headers = [
        "speed",
        "elbow",
        "iterations, most",
        "mean",
        "mean from a box",
        "Rand, paper's",
        "Rand, armloop's",
    ]
    return Outcome(
        theirs,
        ours,
        "agrees" if same and near else "partly" if same or near else "differs",
        f"elbow at {ours['clusters']} (paper 3), iterations {ours['iterations_mean']:.2f} on average and "
        f"{ours['iterations_max']} at most (paper 5.75 and 12)",
        Section(
            "Figure 1: clusters",
            text,
            [
                Picture(
                    clusters_figure(shown), "The paper's indicator on the first motion; the elbow of Eq. (9)."
                )
            ],
            [make_table(headers, rows, f"Median (range) of {context.draws} motions")],
        ),
        {"by_speed": details},
    )


def _noisy(pace: float, seed: int) -> tuple[Motion, np.ndarray]:
    motion, truth = sorting_motion(SCARA.ranges, pace, seed)
    rng = np.random.default_rng([seed, 1])
    v, vdot = (
        x + rng.standard_normal(x.shape) * np.sqrt(np.mean(x**2) * 10 ** (-snr / 10))
        for x, snr in zip((motion.v, motion.vdot), paper.SORTING_SNR, strict=True)
    )
    return Motion(motion.time, motion.q, v, vdot, motion.starts), truth


def _trial(job: tuple[float, int, int]) -> dict[str, float]:
    """Iterations from samples and from a box, Rand indices and elbows of the paper's and the robust indicator."""
    pace, seed, starts = job
    motion, truth = _noisy(pace, seed)
    clusters, robust = sort_samples(motion, "paper"), sort_samples(motion)
    z = clusters.indicator
    by_samples, by_box = (
        [algorithm_1(z, 3, k, how)[0] for k in range(starts)] for how in ("samples", "uniform")
    )
    return {
        "elbow": clusters.elbow,
        "iterations_max": max(by_samples),
        "iterations_mean": float(np.mean(by_samples)),
        "iterations_mean_from_box": float(np.mean(by_box)),
        "rand_paper": float(adjusted_rand_score(truth, clusters.condition)),
        "rand_robust": float(adjusted_rand_score(truth, robust.condition)),
        "elbow_robust": robust.elbow,
    }
