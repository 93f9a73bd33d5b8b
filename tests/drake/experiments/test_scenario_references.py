"""References of scenario files: which kind, how long, and whether the arm's limits hold it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import three_axis

from armloop.drake.experiments import scenario_references as module
from armloop.drake.experiments.scenario_references import reference_of, require_own_fields
from armloop.experiment.excitation import MotionRanges
from armloop.schemas.scenarios import ReferenceData
from armloop.util.errors import ScenarioError

ARM = three_axis()
RANGES = MotionRanges(*(np.full(3, x) for x in (-1.0, 1.0, 1.0, 5.0)))


def within(lower: float, upper: float) -> Any:
    """The arm with such limits of joint 3."""
    return replace(ARM, joints=(*ARM.joints[:2], replace(ARM.joints[2], lower=lower, upper=upper)))


def of(arm: Any = ARM, **data: Any) -> Any:
    given: Any = SimpleNamespace(**({"kind": "paper", "unit": 0.1, "periods": 1, "duration": 20.0} | data))
    return reference_of(given, arm, RANGES, 3, Path("a.yaml"), "a.yaml")


def test_each_kind_is_asked_for_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    at_rest = SimpleNamespace(duration=0.0, evaluate=lambda t: np.zeros((3, len(t), 3)))
    for name in ("paper_reference", "fourier_reference"):
        monkeypatch.setattr(
            module, name, lambda *given, name=name: SimpleNamespace(**vars(at_rest), of=(name, given))
        )
    at_rest.duration = 1.0
    assert of().of == ("paper_reference", (0.1, 1))
    assert of(kind="fourier").of == ("fourier_reference", (RANGES, 20.0, 3))
    with pytest.raises(ScenarioError, match="kind is 'circle'; it must be paper, fourier, places or csv"):
        of(kind="circle")
    with pytest.raises(ScenarioError, match="the paper's is for 3 joints"):
        of(replace(ARM, joints=ARM.joints[:2], X_PF=ARM.X_PF[:2]))


@pytest.mark.parametrize(
    ("lower", "upper", "fits"), [(-0.5, 0.8, True), (-0.49, 0.8, False), (-0.5, 0.79, False)]
)
def test_it_may_go_as_far_as_the_limits(
    lower: float, upper: float, fits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Joint 3 goes to -0.5 and to 0.8 rad, for a moment of two hundredths of a second each."""

    def evaluate(time: Any) -> Any:
        q = np.zeros((len(time), 3))
        q[(time > 2.995) & (time < 3.005), 2] = -0.5
        q[(time > 4.985) & (time < 4.995), 2] = 0.8
        return q, 0 * q, 0 * q

    made = SimpleNamespace(duration=5.0, evaluate=evaluate)
    monkeypatch.setattr(module, "paper_reference", lambda unit, periods: made)
    if fits:
        assert of(within(lower, upper)) is made
    else:
        with pytest.raises(ScenarioError, match=r"joint 3 would go from -0\.5 to 0\.8; its limits are"):
            of(within(lower, upper))


@pytest.mark.parametrize(("duration", "fits"), [(600.0, True), (600.1, False), (np.nan, False)])
@pytest.mark.parametrize("kind", ["csv", "places"])
def test_tables_and_places_last_ten_minutes_at_most(
    kind: str, duration: float, fits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = SimpleNamespace(duration=duration, evaluate=lambda t: np.zeros((3, len(t), 3)))
    asked: list[Any] = []
    for name in ("read_reference", "places_reference"):
        monkeypatch.setattr(module, name, lambda *given, **more: asked.append((given, more)) or made)
    monkeypatch.setattr(module, "beside", lambda path, file, where: (path, file, where))
    places = [[0.0] * 3, [1.0] * 3]
    data: dict[str, Any] = {"kind": kind, "file": "t.csv", "places": places, "dwell": 0.5, "pace": 0.4}
    if fits:
        assert of(**data) is made
        (((first, second, *_), more),) = asked
        if kind == "csv":
            assert first == (Path("a.yaml"), "t.csv", "a.yaml: reference.file") and second == 3
        else:
            assert (first, second, more) == (places, RANGES, {"dwell": 0.5, "pace": 0.4})
    else:
        with pytest.raises(ScenarioError, match="at most"):
            of(**data)


@pytest.mark.parametrize("places", [[], [[0.0] * 3], [[0.0] * 3, [0.0] * 2], [[0.0] * 2, [0.0] * 2]])
def test_two_places_of_all_joints_and_a_files_path(places: list[list[float]]) -> None:
    with pytest.raises(ScenarioError, match="two or more places of 3 numbers each"):
        of(kind="places", places=places, dwell=0.5, pace=0.4)
    with pytest.raises(ScenarioError, match=r"reference\.file is missing"):
        of(kind="csv", file="")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"places": [[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]]}, "reference.places belongs to kind: places"),
        ({"file": "some.csv"}, "reference.file belongs to kind: csv; this reference is of kind paper"),
        ({"kind": "fourier", "periods": 3}, "reference.periods belongs to kind: paper"),
        ({"kind": "places", "duration": 20.0}, "reference.duration belongs to kind: fourier"),
    ],
)
def test_a_field_of_another_kind_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        require_own_fields(ReferenceData(**given), "a.yaml")


def test_fields_of_its_own_and_defaults_are_not() -> None:
    require_own_fields(ReferenceData(kind="places", places=[[0.0], [1.0]], dwell=0.1, pace=2.0), "a.yaml")
    require_own_fields(ReferenceData(kind="fourier", duration=20.0, periods=2), "a.yaml")
    require_own_fields(ReferenceData(kind="no such kind", periods=3), "a.yaml")  # told of elsewhere
