"""Stand-ins for every part of a diagnosis, which keep what they are asked and answer as they are told."""

from __future__ import annotations

import importlib
from contextlib import nullcontext
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.diagnosis.diagnose import diagnose
from armloop.diagnosis.verdict import Diagnosis

module: Any = importlib.import_module("armloop.diagnosis.diagnose")
ROWS = np.ones((4, 3), dtype=bool)


@dataclass
class Standing:
    """What is stated of the joints."""

    reasons: list[str]
    joints: list[Any] = field(default_factory=list)
    unknown: bool = False
    left: tuple[int, ...] = (1,)


class Evidence(SimpleNamespace):
    """A run of three joints, four samples."""

    def residual(self, known: Any) -> str:
        return f"residual of {self.name}"

    def only(self, rows: Any) -> Evidence:
        return Evidence(name=self.name, rows=rows, blocks=None)


class Answers:
    """Stands for every part of the diagnosis; keeps what it is asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **of: Any) -> None:
        self.asked: dict[str, Any] = {}
        given = {
            "contacts": [],
            "still": False,
            "found": [],
            "unlisted": None,
            "turned": False,
            "carried": False,
            "unknown": False,
        }
        self.given = given | {"known": False} | of
        whole = Evidence(name="whole", rows=ROWS.copy(), blocks=np.array([0, 0, 1, 1]))
        self.left = Evidence(name="left", rows=ROWS.copy(), blocks=np.array([0, 0, 1, 1]))
        self.account = Evidence(name="account", rows=ROWS.copy(), blocks=whole.blocks)
        samples = SimpleNamespace(tau=np.ones((4, 3)))
        parts: dict[str, Any] = {
            "require_different": lambda logs: None,
            "misrecorded": lambda *_: "",
            "settled": lambda model, logs: (logs, np.full((1, 3), 0.1)),
            "sentences": lambda model, names, zeros: [f"zeros of {names}"],
            "preprocess": lambda logs, how: samples,
            "hypotheses": lambda arm: ["one", "two"],
            "find_contacts": lambda evidence, residual: self.note(
                "contacts", residual, self.given["contacts"]
            ),
            "without": self.without,
            "too_still": self.still,
            "fit": lambda *_: "nothing",
            "known_contacts": lambda evidence: np.array([self.given["known"], False]),
            "standing": self.standing,
            "_multiples": lambda found: [],
            "Hypotheses": lambda evidence, jobs: nullcontext((evidence.name, jobs)),
            "best_account": self.best,
            "judge_reversals": self.reversals,
            "account_with_load": self.loaded,
            "account_with_cable": self.cabled,
            "account_with_spells": lambda whole, account, logs, progress, jobs: self.note(
                "spells", (whole.name, account.outcome.name, jobs), self.given.get("spells") and account
            ),
            "account_with_onsets": lambda account, logs, progress, jobs: self.note("onsets", jobs, account),
            "outweighed": lambda *_: None,
            "drowned": lambda *_: False,
            "laws_instead": lambda whole, contacts, panel, progress: self.note("laws", panel, ["law"]),
            "told": lambda whole, evidence, contact, laws: (
                (whole.name, evidence.name, laws) == ("whole", "left", ["law"])
                and not self.given.get("untold")
            ),
            "event_untold": lambda event: f"not told: {event}",
            "localised": lambda evidence, outcome, left, known: self.given.get("localised", []),
            "useful": lambda evidence, outcome: self.note("useful", (evidence.name, outcome.name), outcome),
            "plainest": lambda evidence, outcome, among: self.note(
                "plain", (evidence.name, list(among)), outcome
            ),
            "strongest_first": lambda evidence, outcome: self.note("ordered", evidence.name, outcome),
            "without_laws": lambda evidence, laws: evidence,
            "strengths": lambda evidence, outcome: [evidence.name, outcome],
            "of_the_day": lambda whole: None,
        }
        parts["of_the_temperature"] = lambda model, added: self.given.get("of_the_temperature", [])
        parts["of_too_few_logs"] = lambda model, found: self.given.get("of_too_few_logs", [])
        parts["of_a_constant_pull"] = lambda model, added: self.given.get("of_a_constant_pull", [])
        parts["of_an_efficiency"] = lambda added: self.given.get("of_an_efficiency", [])
        parts["with_growth"] = lambda model, found: found
        parts["of_a_balancer"] = lambda model, laws: self.given.get("of_a_balancer", [])
        parts["suspected"] = lambda evidence, found, left: self.note(
            "suspected", (evidence.name, found, left), self.given.get("suspected", [])
        )
        for name, part in parts.items():
            monkeypatch.setattr(module, name, part)

        def of(model: Any, *_: Any) -> Evidence:
            whole.model = model
            return whole

        monkeypatch.setattr(module.Evidence, "of", of)
        monkeypatch.setattr(Diagnosis, "errors", lambda self: {"after": ("errors", self.adopted)})

    def note(self, name: str, asked: Any, answer: Any) -> Any:
        self.asked[name] = asked
        return answer

    def without(self, evidence: Evidence, contacts: Any) -> Evidence:
        whole = "best" in self.asked or (
            "laws" in self.asked and not contacts and self.given["still"] is not True
        )
        return evidence if whole else self.left

    def still(self, evidence: Evidence) -> str:
        still = self.given["still"]
        return "still" if (evidence.name in still if isinstance(still, tuple) else still) else ""

    def standing(
        self, evidence: Evidence, model: Any, errors: Any, joints: Any, found: bool = False
    ) -> Standing:
        self.asked["standing"] = (evidence.name, model, errors, list(joints))
        self.asked["found"] = found
        self.asked["judged"] = evidence.rows
        return Standing(["stands"], unknown=self.given["unknown"])

    def outcome(self, name: str) -> Any:
        return SimpleNamespace(
            name=name,
            found=self.given["found"],
            added=lambda: [*self.given["found"]],
            masked=self.given.get("masked", ()),
        )

    def best(self, whole: Evidence, contacts: Any, progress: Any, panel: Any) -> Any:
        self.asked["best"] = (whole.name, contacts, panel)
        return SimpleNamespace(
            contacts=contacts,
            evidence=self.account,
            outcome=self.outcome("account"),
            laws=[] if self.given["unlisted"] is None else [self.given["unlisted"]],
            without_effect=lambda outcome: SimpleNamespace(contacts=contacts[:1]),
        )

    def loaded(self, whole: Evidence, account: Any, progress: Any, jobs: int | None, logs: Any) -> Any:
        self.asked["carried"] = (whole.name, account.outcome.name, jobs)
        if not self.given["carried"]:
            return None
        evidence, outcome = Evidence(name="loaded", rows=ROWS.copy()), self.outcome("with the load")
        return SimpleNamespace(contacts=[], laws=[], evidence=evidence, outcome=outcome)

    def cabled(self, whole: Evidence, account: Any, progress: Any, jobs: int | None) -> Any:
        self.asked["cable"] = (whole.name, account.outcome.name, jobs)
        if not self.given.get("cable"):
            return None
        return SimpleNamespace(**{**vars(account), "outcome": self.outcome("with the cable")})

    def reversals(self, evidence: Evidence, outcome: Any, kept: Any, progress: Any) -> Any:
        self.asked["kept"] = kept
        if not self.given["turned"]:
            return None
        rows = Evidence(name="turned", rows=ROWS)
        return SimpleNamespace(outcome=self.outcome("turned"), evidence=rows, found=self.given["found"][:1])


def judged(jobs: int | None = None) -> Any:
    """The diagnosis of a log of three joints."""
    model: Any = SimpleNamespace(
        require_torques=lambda: None,
        arm=SimpleNamespace(n=3, name="arm", joints=()),
        conditioning=None,
        with_effects=lambda added: ("with", *added),
    )
    logs: Any = [SimpleNamespace(name="run", joints=3)]
    return diagnose(model, logs, jobs=jobs)


CONTACT = SimpleNamespace(added="push", rows=np.zeros(4, dtype=bool), clear=9.0)
