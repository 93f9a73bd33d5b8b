"""How often what a verdict named was there, by the part of what can be explained: the counts behind `probability`.

python tests/blind/run.py --outside --arms 6 --cases 8 --keep DIR
python tests/blind/calibrate.py DIR...
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from judge import is_named, reliability

from armloop.diagnosis.probability import bin_of


def counts(cases: list[tuple[dict[str, Any], dict[str, Any]]]) -> dict[str, tuple[int, int]]:
    """Named and right, of effects by their bin, of events, and of unlisted laws."""
    found: dict[str, tuple[int, int]] = {}
    for hidden, verdict in cases:
        for effect in verdict["effects"]:
            label = {"event": "event"}.get(effect.get("when", ""), effect["effect"])
            if label not in ("event", "unlisted"):
                one = bin_of(effect["share"], effect["strength"]["times_baseline"])
                label = f"from a share of {one.least_share:g} and {one.least_times:g} times the baseline"
            named, right = found.get(label, (0, 0))
            found[label] = named + 1, right + is_named(hidden, effect)
    return found


def main() -> int:
    """Print counts and the reliability of what is stated."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="kept blind tests, judged")
    cases = []
    for folder in parser.parse_args().folders:
        verdicts = json.loads((folder / "verdicts.json").read_text(encoding="utf-8"))
        for name, verdict in verdicts.items():
            hidden = json.loads((folder / "answers" / f"{name}.json").read_text(encoding="utf-8"))
            cases.append((hidden, verdict))
    for label, (named, right) in sorted(counts(cases).items()):
        print(f"{label}: {right} of {named}")
    print(reliability(cases))
    return 0


if __name__ == "__main__":
    sys.exit(main())
