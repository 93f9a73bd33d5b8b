"""Which samples the standard errors of a regression are told of, and what of their torque."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import fitted


def chunk(cutoff_hz: float = 5.0, condition: tuple[int, ...] = (1, 2, 3, 1, 2, 3)) -> Any:
    """Six samples of two joints; the last is held out, the first two are not independent, one does not move."""
    given = Motion(np.arange(6.0), *np.zeros((3, 6, 2)), np.array([0]))
    moving = np.ones((6, 2), dtype=bool)
    moving[3, 1] = False
    samples = Samples(given, np.full((6, 2), 3.0), moving, 1.0, cutoff_hz)
    return SimpleNamespace(
        samples=samples,
        independent=np.array([False, False, True, True, True, True]),
        held_out=np.array([False] * 5 + [True]),
    )


def test_the_stepwise_rows_move_are_independent_and_not_held_out() -> None:
    (whole,) = fitted.step_rows(chunk(), None)
    assert whole.steps == (1, 2, 3)
    assert np.argwhere(whole.rows).tolist() == [[2, 0], [2, 1], [3, 0], [4, 0], [4, 1]]
    sorter: Any = lambda motion: np.array([1, 1, 1, 2, 3, 3])  # noqa: E731
    by_step = fitted.step_rows(chunk(), sorter)
    assert [(each.steps, np.argwhere(each.rows).tolist()) for each in by_step] == [
        ((1,), [[2, 0], [2, 1]]),
        ((2,), [[3, 0]]),
        ((3,), [[4, 0], [4, 1]]),
    ]


def test_shared_coefficients_use_what_is_held_out_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitted, "sliding_rows", lambda samples: samples.moving)
    for final, held_out in ((None, False), ("found", True)):
        found: Any = SimpleNamespace(final=final)
        (whole,) = fitted.fitted_rows(chunk(), found, shared=True)
        assert whole.steps == (1, 2, 3) and whole.rows[:5].sum() == 9
        assert whole.rows[5].tolist() == [held_out] * 2


@pytest.mark.parametrize(
    ("shared", "in_memory", "taken", "cutoff"),
    [
        (True, True, "reference", 5.0),
        (True, False, "window", 5.0),
        (False, True, "reference", 5.0),
        (False, False, "reference", 0.0),  # an even selection cannot be filtered
    ],
)
def test_a_selection_stands_for_what_is_not_in_memory(
    shared: bool, in_memory: bool, taken: str, cutoff: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = {"reference": chunk(), "window": chunk()}
    parts["window"].samples = replace(chunk().samples, tau=np.full((6, 2), 4.0))
    data: Any = SimpleNamespace(
        reference=parts["reference"], in_memory=in_memory, window=lambda count: parts["window"]
    )
    monkeypatch.setattr(fitted, "fitted_rows", lambda chunk, found, shared: "rows")
    monkeypatch.setattr(fitted, "standard_errors", lambda model, samples, rows: {"samples": samples})
    model: Any = SimpleNamespace(effects=())
    found: Any = None
    samples = fitted.uncertainty(model, data, found, shared)["samples"]
    assert (samples.tau == (4.0 if taken == "window" else 3.0)).all() and samples.cutoff_hz == cutoff


def test_what_effects_add_is_taken_from_the_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    class Model(SimpleNamespace):
        def predict(self, motion: Motion) -> np.ndarray:
            return np.full((6, 2), 2.0 if self.effects else 1.5)

    monkeypatch.setattr(fitted, "replace", lambda of, **new: type(of)(**{**vars(of), **new}))
    monkeypatch.setattr(fitted, "smooth", lambda samples, x: 10 * x)
    monkeypatch.setattr(fitted, "fitted_rows", lambda chunk, found, shared: "rows")
    monkeypatch.setattr(fitted, "standard_errors", lambda model, samples, rows: {"tau": samples.tau})
    data: Any = SimpleNamespace(reference=chunk(), in_memory=True)
    model: Any = Model(effects=("one",))
    found: Any = None
    assert (fitted.uncertainty(model, data, found, False)["tau"] == 3.0 - 10 * 0.5).all()


@pytest.mark.parametrize("alike", [True, False])
def test_logs_are_left_out_whole_though_few_are_cut_into_pieces_for_laws(
    alike: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = np.array([0, 0, 0, 1, 1, 1])
    parts, asked = logs if alike else np.arange(6), []

    def cross_fitted(model: Any, samples: Any, rows: Any, by: np.ndarray) -> Any:
        assert model.effects == ()
        asked.append(by.tolist())
        return by.tolist()

    monkeypatch.setattr(fitted, "replace", lambda of, **new: type(of)(**{**vars(of), **new}))
    monkeypatch.setattr(fitted, "fitted_rows", lambda chunk, found, shared: "rows")
    monkeypatch.setattr(fitted, "problems", lambda model: [SimpleNamespace(unknowns=[0])])
    monkeypatch.setattr(fitted, "training_parts", lambda motion: parts)
    monkeypatch.setattr(fitted, "log_numbers", lambda motion: logs)
    monkeypatch.setattr(fitted, "cross_fitted", cross_fitted)
    monkeypatch.setattr(fitted, "empirical_null", lambda model, samples, left, by: [left, by.tolist()])
    monkeypatch.setattr(fitted, "errors_of_left_out_logs", lambda samples, left, by: (left, by.tolist()))
    data: Any = SimpleNamespace(reference=chunk(), in_memory=True)
    model: Any = SimpleNamespace(effects=())
    nothing: Any = None
    found = fitted.left_out(model, data, nothing, False)
    assert found == {"null": [parts.tolist()] * 2, "logs": (logs.tolist(), logs.tolist())}
    assert asked == ([logs.tolist()] if alike else [parts.tolist(), logs.tolist()])
