"""The help of every command fits the terminal; its examples stay lines that can be copied."""

import pytest

from armloop.cli import COMMANDS, main


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_the_terminal(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    with pytest.raises(SystemExit):
        main([command, "--help"])
    _, _, said = capsys.readouterr().out.partition("\n\n")  # the usage has words that are not to be broken
    text, _, example = said.partition("Example:\n")
    assert max(len(line) for line in text.splitlines()) <= 60
    assert example.startswith(f"  armloop {command}")
