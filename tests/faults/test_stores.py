"""A store of `armloop watch` with a file that was spoilt: one line that names it, or it is made anew."""

from pathlib import Path

import pytest
from faults.conftest import one_line

from armloop.cli import main
from armloop.util.errors import InputError
from armloop.watch.store import Store

WATCH = "watch --models model.json --store s --logs"
# which files hold what instead, and what is said; nothing where they are made anew
SPOILT: dict[str, tuple[str, bytes, str]] = {
    "sums": ("sums/*/*/*.parquet", b"junk", "the sums cannot be read .*; move the file away, and its log is"),
    "no sums": ("sums/*/*/*.parquet", b"", "the sums cannot be read"),
    "what the tests came to": ("tested/*.json", b"{", "cannot be read .*; move it away, and it is made anew"),
    "a mark too deep": ("store.json", b"[" * 100_000, r"store\.json: cannot be read"),
    "a running state": ("running/*", b"junk", ""),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_file_of_the_store_is_spoilt(name: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pattern, content, said = SPOILT[name]
    assert main([*WATCH.split(), "run.csv"]) == 0
    (path,) = (place / "s").glob(pattern)
    if name in ("sums", "no sums"):  # the running state has what the tests need of them
        for state in (place / "s" / "running").iterdir():
            state.unlink()
    path.write_bytes(content)
    capsys.readouterr()
    status = main([*WATCH.split(), "run.csv", "other.csv"])
    if said:
        assert status == 2
        one_line(capsys.readouterr().err, said)
    else:
        assert status == 0


def test_a_mark_that_was_moved_away_is_made_anew(place: Path) -> None:
    assert main([*WATCH.split(), "run.csv"]) == 0
    mark = place / "s" / "store.json"
    whole = mark.read_bytes()
    mark.rename(place / "moved.json")
    assert main([*WATCH.split(), "run.csv"]) == 0
    assert mark.read_bytes() == whole


@pytest.mark.parametrize("told", ['{"alarms": 3}', "{}", '{"alarms": [3]}'])
def test_what_was_told_is_spoilt(told: str, tmp_path: Path) -> None:
    store = Store(tmp_path / "s")
    (tmp_path / "s" / "announced.json").write_text(told)
    with pytest.raises(InputError, match=r"announced\.json: holds no list of alarms; move it away"):
        store.announced()
