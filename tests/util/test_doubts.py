"""What is said of many files is said once."""

from __future__ import annotations

from armloop.util.doubts import gathered


def test_of_many_files_of_which_the_same_is_said_the_first_is_named() -> None:
    lags = [f"run_{k}.csv: columns v lag behind dq/dt by 3.{k} ms" for k in range(5)]
    other = "run_2.csv: joint 3 turns beyond its limits"
    assert gathered([*lags[:2], other, *lags[2:]]) == [
        f"{lags[0]} (the same, but for its numbers, of 4 more)",
        other,
    ]
    assert gathered([*lags[:3], other]) == [*lags[:3], other]
    # lines that are of no file are themselves
    bare = ["no file at all", "nor here", "nor there", "nor anywhere"]
    assert gathered(bare) == bare
