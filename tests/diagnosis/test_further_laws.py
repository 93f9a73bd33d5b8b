"""Laws of other joints beside the largest residual: which are asked, stated, and what goes for them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from armloop.diagnosis import unlisted


class Law:
    """A law of a joint (1-based) with terms that are functions of others."""

    def __init__(self, joint: int, terms: tuple[str, ...], of: tuple[int, ...] = ()) -> None:
        self.joint, self.parameters = joint, dict.fromkeys((*terms, *(("q_low",) if terms else ())), 1.0)
        self.of = (joint, *of)

    def added(self) -> list[Any]:
        effect = SimpleNamespace(joints=lambda values: list(self.of))
        return [SimpleNamespace(effect=effect, values={})] if self.parameters else []


def outcome(*places: str) -> Any:
    return SimpleNamespace(found=[SimpleNamespace(effect=SimpleNamespace(place=place)) for place in places])


class Asked:
    """What is asked of the parts, which answer in turn."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, left: list[int | None], laws: list[Any]) -> None:
        self.left, self.refitted = list[Any](), list[Any]()
        joints, answers = iter(left), iter(laws)

        def left_over(evidence: Any, beside: Any, but: Any, partners: Any) -> int | None:
            self.left.append((evidence, set(but), set(partners)))
            return next(joints)

        def refitted(evidence: Any, kept: Any) -> Any:
            self.refitted.append((evidence, kept))
            return kept

        monkeypatch.setattr(unlisted, "_left_over", left_over)
        monkeypatch.setattr(unlisted, "refitted", refitted)
        monkeypatch.setattr(unlisted, "_law_at", lambda evidence, beside, j, again: next(answers))
        monkeypatch.setattr(
            unlisted, "without_laws", lambda evidence, laws: f"without {[law.joint for law in laws]}"
        )


def test_a_law_that_is_stated_takes_its_torque_and_its_partners_along(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, second = Law(2, ("sin(q2-q3)",), (3,)), Law(3, ("sin(q2-q3)",), (2,))
    found = outcome("offset at 3", "drag at 1")
    kept = outcome("drag at 1")
    asked = Asked(monkeypatch, [2, 0, None], [(second, kept), (None, kept)])
    evidence: Any = "all"
    given: Any = first
    assert unlisted.further_laws(evidence, found, given, lambda text: None) == ([second], kept)
    assert asked.left == [
        ("without [2]", {1}, {1, 2}),
        ("without [2, 3]", {1, 2}, {1, 2}),
        ("without [2, 3]", {0, 1, 2}, {1, 2}),
    ]
    # what stood for the second law is struck off, on the whole run
    assert ("all", kept) in asked.refitted


@pytest.mark.parametrize("law", [None, Law(3, ()), Law(3, ("1", "sign(v3)"))])
def test_what_is_no_law_or_a_sum_of_listed_effects_is_not_stated(
    law: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, other = outcome("offset at 3"), outcome()
    asked = Asked(monkeypatch, [2, None], [(law, other)])
    evidence: Any = "all"
    given: Any = Law(2, ("sin(q2)",))
    assert unlisted.further_laws(evidence, found, given, lambda text: None) == ([], found)
    assert [but for _, but, _ in asked.left] == [{1}, {1, 2}] and ("all", other) not in asked.refitted
