"""Run the commands whose reports the gallery shows; `make docs` calls it before the site is built.

The commands stand in ``gallery.md``, so that what is shown is what was run.
"""

import re
import shlex
import shutil
import sys
from pathlib import Path

from armloop.cli import main

GALLERY = Path(__file__).resolve().parent / "gallery.md"


def commands() -> list[list[str]]:
    """The words of the gallery's commands, behind `armloop`."""
    (block,) = re.findall(r"```sh\n(.*?)```", GALLERY.read_text(encoding="utf-8"), re.DOTALL)
    lines = block.replace("\\\n", " ").splitlines()
    return [shlex.split(line)[1:] for line in lines if line.strip()]


if __name__ == "__main__":
    shutil.rmtree(GALLERY.parent / "reports", ignore_errors=True)
    for words in commands():
        if main(words) != 0:
            sys.exit(f"armloop {shlex.join(words)} failed")
