"""What all tests share: one thread per process, no screen, and the way to the measured logs."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

# before numpy is imported: the tests run in one process per core, where more threads only hinder
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

import pytest  # noqa: E402

REPOSITORY = Path(__file__).resolve().parents[1]
MEASURED = REPOSITORY.parent / "shared" / "data"
#: The files that take longest, first every command of the README.
LONGEST = (
    "fresh/test_readme.py",
    "measured/test_ur10e.py",
    "diagnosis/test_diagnosis.py",
    "blind/test_blind.py",
    "diagnosis/test_carried.py",
    "measured/test_ur5.py",
    "identification/reconstruction/test_mounting.py",
    "identification/reconstruction/test_readings.py",
    "workflows/test_by_hand.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take long, so that no process waits for another's last file."""
    first = {REPOSITORY / "tests" / name: place for place, name in enumerate(LONGEST)}
    long = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: (first.get(item.path, len(first)), item.path not in long))


@pytest.fixture(autouse=True, scope="session")
def _no_teams() -> None:
    """A diagnosis tries its hypotheses in the test's own process: every core has one already."""
    from armloop.util import workers

    workers._TEAM = 1


@pytest.fixture(autouse=True, scope="session")
def _no_drawings() -> Iterator[Callable[..., str]]:
    """Figures are made, and written out by the tests of reports alone: a page takes as long as the diagnosis it is of."""
    from armloop.reports import html

    drawn = html.svg
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            html,
            "svg",
            lambda figure, narrow=None: figure if isinstance(figure, str) else '<svg class="wide"></svg>',
        )
        yield drawn


@pytest.fixture(scope="session")
def repository() -> Path:
    """The root of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def measured() -> Path:
    """The folder of the measured logs; skips the test where it is not at hand."""
    if not MEASURED.is_dir():
        pytest.skip(f"the measured logs are not at hand: no folder {MEASURED}")
    return MEASURED
