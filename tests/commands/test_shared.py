"""Progress is seen by who looks at a terminal, and by nobody else."""

from __future__ import annotations

import sys

import pytest

from armloop.commands.shared import progress


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_is_on_standard_error_of_a_terminal_and_never_in_the_answer(
    terminal: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    progress()("reading 5% of it")
    answer = capsys.readouterr()
    assert answer.out == "" and answer.err == ("  … reading 5 % of it\n" if terminal else "")
