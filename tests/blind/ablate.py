"""What each rule of the diagnosis is for: a blind test judged again with one rule left out at a time.

    python tests/blind/run.py --outside --arms 6 --cases 8 --first 433 --keep DIR     make and judge a blind test
    python tests/blind/ablate.py DIR                                                 judge it again, rule by rule

Every run is judged once with all rules, each of which notes whether it changed anything, and once more without each of those
that did. Judging knows the folder of logs and nothing else; the answers are opened for the table, which names, rule by
rule, the cases that are right because of it and those that would be right without it. What has been judged is kept in
``DIR/ablation.json``, so that a run that was ended goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from armloop.data.log import read_log
from armloop.diagnosis import (
    account,
    contacts,
    diagnose,
    evidence,
    innovations,
    judgement,
    outcomes,
    posterior,
    reversals,
    search,
    trials,
    unlisted,
)
from armloop.model import load_model
from armloop.util.errors import InputError


@dataclass(frozen=True)
class Rule:
    """A function of the diagnosis, and what stands in for it when it is left out.

    Attributes:
        name: what it says.
        places: (module or class, name) where it is looked up.
        without: its stand-in, of the same arguments.
    """

    name: str
    places: tuple[tuple[Any, str], ...]
    without: Callable[..., Any]


def _rule(name: str, without: Callable[..., Any], *places: tuple[Any, str]) -> Rule:
    return Rule(name, places, without)


diagnosing = sys.modules["armloop.diagnosis.diagnose"]
RULES = [
    _rule("what comes back with the motion is no event", lambda *_: False, (contacts, "comes_back")),
    _rule("what is a function of a joint's speed is no event", lambda *_: False, (contacts, "rubs")),
    _rule(
        "a joint that sticks shows no event of up to twice its friction",
        lambda *_: False,
        (contacts, "_sticks"),
    ),
    _rule("no event beyond the trained range", lambda *_: False, (contacts, "_strays")),
    _rule("an event stands out", lambda motion, rows, level, bursts: bursts, (contacts, "_standing_out")),
    _rule("an event begins and ends in its run", lambda *_: True, (contacts, "_seen_whole")),
    _rule("what differs from before and after is an event", lambda *_: [], (contacts, "pulses")),
    _rule("of events that overlap one is listed", lambda motion, found: found, (contacts, "_distinct")),
    _rule(
        "two events between which nothing tells may be one",
        lambda *_: None,
        (contacts, "_with_what_is_between"),
    ),
    _rule(
        "joints that slide hold the friction of gears that they share",
        lambda e, known, slow: np.zeros_like(e.samples.tau),
        (innovations, "shared_dry"),
    ),
    _rule(
        "joints that turn round tell nothing of an event",
        lambda m, x: np.zeros_like(x),
        (contacts, "turning"),
    ),
    _rule(
        "friction may hold what it can",
        lambda e, known=(): np.zeros_like(e.samples.tau),
        (innovations, "dry_level"),
    ),
    _rule(
        "a model that contradicts itself is unsure",
        lambda m, x: np.zeros_like(x.q),
        (innovations, "contradiction"),
    ),
    _rule("after a delay, joints rest as long as recorded", lambda e, s: e, (account, "_resting_late")),
    _rule(
        "nothing is judged far outside the trained range",
        lambda m, r: np.zeros(m.q.shape, dtype=bool),
        (evidence, "far_outside"),
        (contacts, "far_outside"),
    ),
    _rule(
        "nothing is judged below the slowest trained speed",
        lambda model, samples: np.zeros(samples.tau.shape, dtype=bool),
        (evidence, "too_slow"),
    ),
    _rule("a joint that is shaken rests", lambda s, m: s.moving.copy(), (evidence, "_sliding")),
    _rule("listed effects before a law", lambda self, *_: self, (account.Account, "_or_listed")),
    _rule("what is plain together alone is stated", lambda *_: False, (search, "_are_needed")),
    _rule("two at once", lambda *_: iter(()), (search._Search, "_pairs")),
    _rule(
        "odds against every parameter",
        lambda e, effects: 0.0,
        (posterior, "log_prior"),
        (trials, "log_prior"),
    ),
    _rule(
        "more than the worst tenth of the baseline",
        lambda e, score: np.full(len(score.rows), 1e-12),
        (judgement, "enough"),
        (unlisted, "enough"),
    ),
    _rule("or than what looks like it", lambda *_: False, (judgement, "exceeds_null")),
    _rule("twice that for a law that ties two joints", lambda effect: 1, (outcomes, "_tied")),
    _rule(
        "an offset as large as more friction is of one cause", lambda found, fit: found, (search, "one_way")
    ),
    _rule("a coefficient is clear", lambda e, outcome: outcome, (search, "clear")),
    _rule("the likelihood ratio counts too", lambda *_: -np.inf, (judgement, "_likelier")),
    _rule("effects beside a law must be worth it", lambda e, outcome: outcome, (unlisted, "pruned")),
    _rule(
        "one law instead of several effects",
        lambda e, outcome, p: (None, outcome),
        (unlisted, "_one_instead"),
    ),
    _rule("a simpler law takes their place", lambda *_: False, (unlisted, "_is_simpler")),
    _rule("a law of listed functions is none", lambda self, j: False, (unlisted.Law, "is_listed")),
    _rule("a law that is found is real", lambda *_: False, (unlisted, "_follows_a_law")),
    _rule("only what lasts is a law", lambda *_: 1.0, (unlisted, "lasting")),
    _rule("unlisted laws", lambda *_: None, (unlisted, "_left_over")),
    _rule("reversals apart", lambda *_: None, (diagnosing, "judge_reversals")),
    _rule(
        "drives of an arm are alike at reversals",
        lambda self, effect, j: reversals._positive(self.by_effect[effect][j].ratios),
        (reversals._Gains, "_sure"),
    ),
]


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(one, other))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(_same(a, b) for a, b in zip(one, other, strict=True))
    if hasattr(one, "effect") and hasattr(other, "effect"):
        return bool(one.effect.place == other.effect.place)
    return one is other or bool(isinstance(one, bool | int | float) and one == other)


@contextmanager
def _in_place(
    rules: list[Rule], make: Callable[[Rule, Callable[..., Any]], Callable[..., Any]]
) -> Iterator[None]:
    """The rules' functions replaced by what is made of them."""
    kept = [(place, name, getattr(place, name)) for rule in rules for place, name in rule.places]
    made = {
        id(own): make(rule, own)
        for rule in rules
        for place, name in rule.places
        for own in [getattr(place, name)]
    }
    try:
        for place, name, own in kept:
            setattr(place, name, made[id(own)])
        yield
    finally:
        for place, name, own in kept:
            setattr(place, name, own)


def judged(folder: Path, run: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """The verdict with all rules, and those without each of the rules that changed anything."""
    model, log = load_model(folder / "model.json"), read_log(run)
    acted: set[str] = set()

    def noting(rule: Rule, own: Callable[..., Any]) -> Callable[..., Any]:
        def both(*given: Any) -> Any:
            found = own(*given)
            if rule.name not in acted and not _same(found, rule.without(*given)):
                acted.add(rule.name)
            return found

        return both

    with _in_place(RULES, noting):
        whole = _verdict(model, log)
    without = {}
    for rule in RULES:
        if rule.name in acted:
            with _in_place([rule], lambda rule, own: rule.without):
                without[rule.name] = _verdict(model, log)
    return whole, without


def _verdict(model: Any, log: Any) -> dict[str, Any]:
    try:
        return diagnose(model, [log], jobs=1).to_dict()
    except InputError as error:
        return {"verdict": f"refused: {error}", "effects": []}


def main() -> None:
    """Judge, open the answers, print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kept", type=Path, metavar="DIR", help="a blind test that was kept and judged")
    parser.add_argument("--minutes", type=float, default=np.inf, help="end after so long; a new run goes on")
    options = parser.parse_args()
    threadpool_limits(1)
    begin, file = time.monotonic(), options.kept / "ablation.json"
    found = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    runs = [run for folder in sorted((options.kept / "logs").iterdir()) for run in folder.glob("run_*.csv")]
    # a few runs of every arm before more of the first
    for run in sorted(runs, key=lambda run: (run.name, run.parent.name)):
        name = f"{run.parent.name}_{run.stem}"
        if name not in found and time.monotonic() - begin < 60 * options.minutes:
            found[name] = judged(run.parent, run)
            file.write_text(json.dumps(found), encoding="utf-8")
            print(
                f"  … {len(found)}/{len(runs)} runs judged, {name} {len(found[name][1])} times more",
                flush=True,
            )
    print(_table(options.kept, found))


def _table(kept: Path, found: dict[str, Any]) -> str:
    from judge import is_right

    from armloop.reports.tables import make_table

    answers = {
        name: json.loads((kept / "answers" / f"{name}.json").read_text(encoding="utf-8")) for name in found
    }
    rows: list[list[object]] = []
    for rule in RULES:
        acted = [name for name, (_, without) in found.items() if rule.name in without]
        pairs = {
            name: (
                is_right(answers[name], found[name][0]),
                is_right(answers[name], found[name][1][rule.name]),
            )
            for name in acted
        }
        saved = [name for name, (own, other) in pairs.items() if own and not other]
        cost = [name for name, (own, other) in pairs.items() if other and not own]
        rows.append(
            [rule.name, len(acted), len(saved), len(cost), ", ".join((saved + [f"({c})" for c in cost])[:3])]
        )
    headers = ["rule", "acted", "saves", "costs", "for instance"]
    return str(make_table(headers, rows, f"{len(found)} runs, one rule left out at a time", left=(0, 4)))


if __name__ == "__main__":
    main()
