"""Verdicts on the runs of one arm, from its logs alone: nothing of the generator or its answers is imported or read.

python tests/blind/verdicts.py logs/arm_1 verdicts.json
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from armloop.data.log import read_log
from armloop.diagnosis import diagnose
from armloop.identification.reconstruction import reconstruct
from armloop.model import load_model
from armloop.robot.arm import load_arm
from armloop.util.errors import InputError


def verdicts(folder: Path) -> dict[str, dict[str, Any]]:
    """Reconstruct the arm's model from its baseline logs, if that was not done, and diagnose every run."""
    model_file = folder / "model.json"
    if not model_file.exists():
        baseline = [read_log(path) for path in sorted(folder.glob("baseline_*.csv"))]
        reconstruct(baseline, load_arm(folder / "arm.urdf")).model.save(model_file)
    model = load_model(model_file)
    found = {}
    for path in sorted(folder.glob("run_*.csv")):
        try:
            found[f"{folder.name}_{path.stem}"] = diagnose(model, [read_log(path)], jobs=1).to_dict()
        except InputError as error:
            found[f"{folder.name}_{path.stem}"] = {"verdict": f"refused: {error}", "effects": []}
    return found


if __name__ == "__main__":
    threadpool_limits(1)
    Path(sys.argv[2]).write_text(json.dumps(verdicts(Path(sys.argv[1]))), encoding="utf-8")
