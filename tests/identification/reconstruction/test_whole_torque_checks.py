"""What is said of a whole record of torques: which fault is raised before which, and of the arm as it stands."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from synthetic import three_axis

from armloop.identification.reconstruction import torque_checks
from armloop.identification.reconstruction.torque_checks import check_torques
from armloop.util.errors import InputWarning, LogError


class TestWhole:
    """Of logs with names, whose faults are given."""

    @pytest.fixture
    def asked(self, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
        asked: dict[str, Any] = {"problems": 0, "given": True, "turned": [], "exchanged": [], "scaled": []}

        class Given:
            def fit(self, signs: Any = None, order: Any = None) -> str:
                return "plain" if signs is order is None else "mended"

            def turned(self, plain: str) -> Any:
                return asked["turned"]

            def better_exchanged(self, plain: str) -> Any:
                return asked["exchanged"]

            def better_scaled(self, plain: str) -> Any:
                return asked["scaled"]

            @staticmethod
            def of(logs: Any, arm: Any, cutoff_hz: float, aside: Any = None) -> Any:
                asked["problems"] += 1
                return Given() if asked["given"] else None

        monkeypatch.setattr(torque_checks, "Problem", Given)
        monkeypatch.setattr(torque_checks, "placed_runs", lambda logs: list(enumerate(logs)))
        monkeypatch.setattr(torque_checks, "is_time_series", lambda q, runs: q)
        monkeypatch.setattr(
            torque_checks, "meant", lambda *given: (asked.get("meant", {}).get(given[1], ""), None)
        )
        monkeypatch.setattr(torque_checks, "together", lambda *_: [])
        monkeypatch.setattr(torque_checks, "times_lighter", lambda *_: asked.get("lighter", 0.0))
        monkeypatch.setattr(torque_checks, "weight_alone", lambda *_: False)
        return asked

    @staticmethod
    def check(names: str, cutoff: float = 10.0, series: tuple[bool, ...] = ()) -> str:
        logs: Any = [SimpleNamespace(name=name, q=True, runs=lambda: None) for name in names]
        for log, one in zip(logs, series, strict=False):
            log.q = one
        try:
            check_torques(logs, three_axis(), cutoff)
        except LogError as error:
            return str(error)
        return ""

    def test_series_that_are_filtered_are_looked_at_if_they_move_enough(self, asked: dict[str, Any]) -> None:
        asked["turned"] = [1]
        assert self.check("a", 0.0) == self.check("ab", series=(True, False)) == "" and not asked["problems"]
        asked["given"] = False
        assert self.check("a", 0.5) == "" and asked["problems"] == 1
        asked["given"] = True
        assert self.check("a", 0.5).startswith("a: the sign of tau2 is turned: ")

    def test_three_logs_are_named_each_once(self, asked: dict[str, Any]) -> None:
        asked["turned"] = [0, 2]
        for names, said in (("aba", "a, b"), ("abc", "a, b, c"), ("abcd", "a, b, c, ...")):
            assert self.check(names).startswith(f"{said}: the sign of tau1, tau3 is turned: ")
        asked["turned"] = [0, 1, 2]
        assert self.check("a").startswith("a: the sign of all joints is turned: ")

    def test_joints_count_from_one(self, asked: dict[str, Any]) -> None:
        assert self.check("a") == ""
        asked["scaled"] = [(1, 0.1)]
        assert "fit one another: tau2 is about 10 times what" in self.check("a")
        asked["exchanged"] = [(0, 2)]
        assert "columns tau1 and tau3 are exchanged" in self.check("a")

    @pytest.mark.parametrize(("fault", "found"), [("scaled", (1, 0.1)), ("exchanged", (0, 2))])
    def test_a_record_read_wrongly_is_named_before_a_column_that_looks_like_it(
        self, fault: str, found: tuple[Any, ...], asked: dict[str, Any]
    ) -> None:
        asked[fault] = [found]
        asked["meant"] = {"plain": "it lies"}
        assert "tau" in self.check("a")
        asked["meant"] = {"plain": "it lies", "mended": "it lies"}
        assert self.check("a") == "a: it lies"
        # one that explains far more than the column put right, but no more than the record as it stands
        asked["meant"] = {"mended": "it lies"}
        assert "tau" in self.check("a")

    def test_an_arm_that_lies_may_hang_from_drives_that_carry_it(self, asked: dict[str, Any]) -> None:
        asked["lighter"] = 3.14
        with pytest.warns(InputWarning, match=r"a: the torques hold no weight: .* 3\.1 times as well"):
            assert self.check("a") == ""
        asked["meant"] = {"plain": "it lies"}
        assert self.check("a").startswith("a: it lies; or the torques hold no weight: without gravity")


@pytest.mark.parametrize("still", ["", "they are exchanged"])
@pytest.mark.parametrize("slight", [True, False])
def test_what_is_wrong_is_asked_once_more_of_the_arm_as_it_stands(
    slight: bool, still: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Several zeros that are a little off may look like one that is far off, or like other columns."""
    arm = SimpleNamespace(n=1)
    stands: Any = SimpleNamespace(fit=lambda: "as it stands")
    problem: Any = SimpleNamespace(arm=arm, as_of=lambda of: stands if of == "off" else None)
    found: Any = [SimpleNamespace(of=lambda of: "off" if of is arm else None)] if slight else []
    monkeypatch.setattr(torque_checks, "together", lambda problem, plain: found)
    said = {"plain": ("they are exchanged", None), "as it stands": (still, None)}
    monkeypatch.setattr(torque_checks, "meant", lambda of, left: said[left])
    plain: Any = "plain"
    assert torque_checks._otherwise(problem, plain) == (
        still if slight else "they are exchanged",
        found,
    )
