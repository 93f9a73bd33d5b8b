"""Build the site, strictly and offline: run the gallery's commands, execute the tutorials, make the pages.

What was executed is kept until the package, a tutorial or the gallery changes: another armloop's answers are never shown.
The tests build the site, too, with the reports that the README's commands have just left (``--reports``).
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import armloop
import armloop_paper
from armloop.util.resources import scenario_names, scenario_path, urdf_names, urdf_path

DOCS = Path(__file__).resolve().parent
GALLERY, REPORTS, TUTORIALS = DOCS / "gallery.md", DOCS / "reports", DOCS / "tutorials"
#: Where mkdocs-jupyter keeps executed tutorials, and what all that was executed depended on.
CACHE = DOCS.parent / ".cache"
KEY = CACHE / "executed"


def commands() -> list[str]:
    """The gallery's commands, one a line."""
    (block,) = re.findall(r"```sh\n(.*?)```", GALLERY.read_text(encoding="utf-8"), re.DOTALL)
    return [line for line in block.replace("\\\n", " ").splitlines() if line.strip()]


def main() -> None:
    """Execute what is out of date, then build."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--reports", type=Path, help="folder that the gallery's commands have written to")
    given = options.parse_args().reports
    key = _key()
    if given is not None or not KEY.is_file() or KEY.read_text() != key:
        for folder in (CACHE, REPORTS, TUTORIALS / "out"):
            shutil.rmtree(folder, ignore_errors=True)
    if not REPORTS.is_dir():
        _show(given or _run())
    quiet = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}  # the versions are the lock's
    built = subprocess.run(
        ["mkdocs", "build", "--strict", "--quiet"], cwd=DOCS.parent, env=quiet, check=False
    )
    if built.returncode:
        sys.exit("the site cannot be built; what mkdocs says stands above")
    CACHE.mkdir(exist_ok=True)
    KEY.write_text(key)


def _run() -> Path:
    """Run the gallery's commands; returns the folder that they have written to."""
    place = DOCS.parent / "out" / "gallery"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for line in commands():
        print(line, flush=True)
        done = subprocess.run(line, shell=True, cwd=place, stdout=subprocess.DEVNULL, check=False)
        if done.returncode:
            sys.exit(f"{line}: status {done.returncode}")
    return place / "out"


def _show(folder: Path) -> None:
    """Copy the pages that the gallery names to where it names them."""
    for page in re.findall(r"\]\(reports/([^)]+)\)", GALLERY.read_text(encoding="utf-8")):
        (REPORTS / page).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / page, REPORTS / page)


def _key() -> str:
    """The content that what is executed depends on."""
    total = hashlib.sha256()
    for path in _sources():
        total.update(f"{path.name} {path.stat().st_size}\n".encode())
        total.update(path.read_bytes())
    return total.hexdigest()


def _sources() -> Iterator[Path]:
    yield GALLERY
    yield from sorted(TUTORIALS.glob("*.py"))
    for package in (armloop, armloop_paper):
        yield from sorted(Path(package.__file__).parent.rglob("*.py"))
    yield from (*map(urdf_path, urdf_names()), *map(scenario_path, scenario_names()))


if __name__ == "__main__":
    main()
