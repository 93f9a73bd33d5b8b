"""Progress is seen by who looks at a terminal or into a job's log, and never in an answer for programs."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from armloop.commands.shared import progress


@pytest.mark.parametrize("json", [True, False])
@pytest.mark.parametrize("terminal", [True, False])
def test_progress_is_on_a_terminals_standard_error_else_before_the_answer_for_people(
    terminal: bool, json: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    options: Any = SimpleNamespace(json=json)
    progress(options)("reading 5% of it")
    answer, line = capsys.readouterr(), "  … reading 5 % of it\n"
    assert answer.err == (line if terminal else "")
    assert answer.out == ("" if terminal or json else line)


def test_a_terminal_of_few_letters_gets_tables_that_can_be_read() -> None:
    script = "import armloop.cli as c; c.main(['cluster']); print('─── 2.1 N·m ± 0.1°, η → ü')"
    env = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == r"--- 2.1 N*m +- 0.1deg, eta -> \xfc", done.stderr
