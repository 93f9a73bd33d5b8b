"""Sort the samples of logs by condition."""

from __future__ import annotations

from armloop.commands.arguments import Json, Logs, seed
from armloop.commands.options import option
from armloop.util.errors import InputError

HELP = "sort samples into static, constant-velocity and varying-velocity data"
EXAMPLE = "armloop cluster out/logs/*.csv"


class Cluster(Logs, Json):
    """The options."""

    indicator: str = option(
        "the paper's relative activation indicator, or one whose switch follows the noise (%(default)s)",
        "robust",
        choices=("robust", "paper"),
    )
    seed: int = option("of k-means (%(default)s)", 0, type=seed)


def run(options: Cluster) -> None:
    """Sort the samples of logs by condition."""
    from armloop.commands.shared import TORQUE, print_json, read_logs
    from armloop.data.regimes import sort_samples
    from armloop.data.repeats import require_different
    from armloop.data.signals import Conditioning, as_torque, preprocess
    from armloop.reports.tables import table
    from armloop.reports.words import percent

    logs = read_logs(options.logs, None, TORQUE)
    widths = {log.joints for log in logs}
    if len(widths) > 1:
        raise InputError(f"the logs have {sorted(widths)} joints; give logs of one arm")
    require_different(logs)
    samples = preprocess(logs, Conditioning())
    clusters = sort_samples(as_torque(samples).motion, options.indicator, options.seed)
    if options.json:
        print_json(
            {
                "counts": clusters.counts(),
                "elbow": clusters.elbow,
                "wcss": clusters.wcss,
                "iterations": clusters.iterations,
                "samples": samples.motion.samples,
            }
        )
        return
    rows = [
        [name, count, percent(count / samples.motion.samples)] for name, count in clusters.counts().items()
    ]
    print(table(["condition", "samples", "share"], rows))
    print("\nwithin-cluster sum for 1, 2, … clusters: " + ", ".join(f"{w:.4g}" for w in clusters.wcss))
    print(f"the elbow suggests {clusters.elbow} clusters; k-means took {clusters.iterations} iterations")
