"""Some rows of a Parquet file: the right ones, in little memory, however many rows the file keeps together."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from armloop.data.tables import read_columns


def written(path: Path, rows: int, together: int) -> np.ndarray:
    x = np.random.default_rng(0).normal(size=rows)
    pyarrow.parquet.write_table(pyarrow.table({"x": x, "y": -x}), path, row_group_size=together)
    return x


@pytest.mark.parametrize("rows", [(0, 10), (9, 11), (10, 20), (25, 61), (60, 64), (0, 64)])
def test_rows_are_those_asked_for(tmp_path: Path, rows: tuple[int, int]) -> None:
    x = written(tmp_path / "log.parquet", 64, together=10)
    found = read_columns(tmp_path / "log.parquet", ["y", "x"], rows)
    np.testing.assert_array_equal(found["x"], x[slice(*rows)])
    np.testing.assert_array_equal(found["y"], -x[slice(*rows)])


def test_a_million_rows_kept_together_are_not_read_at_once(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    x = written(path, 1_000_000, together=1_000_000)
    read = f"read_columns(Path({str(path)!r}), ['x', 'y'], (500_000, 510_000))['x'].sum()"
    program = f"""
from pathlib import Path
import pyarrow
from armloop.data.tables import read_columns
print({read}, pyarrow.default_memory_pool().max_memory())
"""
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    found, most = map(float, answer.stdout.split())
    assert np.isclose(found, x[500_000:510_000].sum())
    assert 0 < most < x.nbytes, "half of what the two columns take"
