"""A small fleet: logs of three arms on disk, of which one carries a load and one rubs more from some log on."""

from pathlib import Path

import numpy as np
import pytest
from operation import Change, healthy_model, operate

from armloop.data.log import write_log

#: Logs of each arm, and the first one after a change.
LOGS, CHANGED = 40, 26


def put(folder: Path, seed: int, k: int, change: Change | None = None, seconds: float = 20.0) -> Path:
    """Write one log, ten a day from 2026-01-01."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"2026-01-{1 + k // 10:02d}T{2 * (k % 10):02d}-30.parquet"
    write_log(path, operate(seed, k, change, seconds))
    return path


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `models` and `logs`."""
    root = tmp_path_factory.mktemp("fleet")
    model = healthy_model()
    changes = {
        "healthy": Change(),
        "loaded": Change(mass=0.3),
        "rubbing": Change(friction=np.array([0.0, 0.05, 0.0])),
    }
    for seed, (arm, change) in enumerate(changes.items(), start=11):
        (root / "models").mkdir(exist_ok=True)
        model.save(root / "models" / f"{arm}.json")
        for k in range(LOGS):
            put(root / "logs" / arm, seed, k, change if k >= CHANGED else None)
    return root
