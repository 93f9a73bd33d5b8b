"""The commands and the code of the README and of pages, and how they are run as they stand."""

import glob
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)


def blocks(language: str, page: str = "README.md") -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return [body for kind, body in BLOCK.findall(text) if kind == language]


def commands(program: str, page: str = "README.md") -> list[str]:
    lines = "\n".join(blocks("sh", page)).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith(program)]


def run(command: list[str], cwd: Path, **environment: str) -> str:
    done = subprocess.run(
        command,
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=1500,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def armloop(line: str, cwd: Path, python: str | os.PathLike[str] = sys.executable) -> str:
    """Run one line as a shell would, wildcards included."""
    words: list[str] = []
    for word in shlex.split(line)[1:]:
        found = sorted(glob.glob(word, root_dir=cwd)) if "*" in word and "/" in word else [word]
        assert found, f"{word} matches nothing"
        words += found
    return run([str(python), "-m", "armloop", *words], cwd)
