"""Laws that an arm had all along are found in its training data, with their parameters; a bare arm has none."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.cli import main
from armloop.data.log import MotionLog, write_log
from armloop.data.motion import Motion
from armloop.identification.reconstruction import Options, Reconstruction, catalogue, reconstruct
from armloop.model import load_model

Array = NDArray[np.float64]
PLAIN = Options(standard_errors=False, parts=False)
COUPLING = {"inertia": 0.05, "viscous": 0.4, "coulomb": 0.5}
SPRING = {"stiffness": 6.0, "rest": 0.3}


def coupled(motion: Motion, ratio: float = -1.0, inertia: float = COUPLING["inertia"]) -> Array:
    """A motor that turns with v2 ± v3."""
    v, vdot = motion.v, motion.vdot
    w, rate = v[:, 1] + ratio * v[:, 2], vdot[:, 1] + ratio * vdot[:, 2]
    torque = inertia * rate + COUPLING["viscous"] * w + COUPLING["coulomb"] * np.sign(w)
    return np.outer(torque, [0, 1, ratio])


def sprung(motion: Motion) -> Array:
    return np.outer(SPRING["stiffness"] * (motion.q[:, 1] - SPRING["rest"]), [0, 1, 0])


def made(laws: list, seed: int = 0, seconds: float = 40, library: str = "rigid-body") -> Reconstruction:
    """A reconstruction by itself; :func:`of_coupled` is one that several tests look at."""
    return reconstruct([run(laws, seed, seconds)], three_axis(), library=library, options=PLAIN)


@cache
def of_coupled(seed: int) -> Reconstruction:
    return made([coupled], seed)


def run(laws: list, seed: int = 0, seconds: float = 40) -> MotionLog:
    motion = fourier_motion(seconds, 100, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau + sum(law(motion) for law in laws), seed, name="run")


def named(made: Reconstruction) -> list[tuple[str, int | None, int | None]]:
    return [added.effect.place for added in made.model.effects]


def check(added, truth: dict[str, float]) -> None:
    """Within four standard errors, which are small."""
    for key, value in truth.items():
        found = added.parameters[key]
        assert abs(found.value - value) < 4 * found.std_error + 0.02 * abs(value), key


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2))])
def test_a_bare_arm_has_none(seed: int) -> None:
    assert named(made([], seed)) == []


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_a_coupling_is_found_in_the_training_data(seed: int) -> None:
    found = of_coupled(seed)
    assert named(found) == [("transmission_coupling", 2, 3)]
    (added,) = found.model.effects
    check(added, COUPLING)
    assert added.parameters["ratio"].value == -1.0
    assert any("always there" in note for note in found.notes)
    assert max(found.held_out.moving["nrmse"]) < 0.05


@pytest.mark.parametrize("physical", [True, pytest.param(False, marks=pytest.mark.long)])
def test_a_coupling_of_gears_without_a_motor_has_no_negative_inertia(physical: bool, tmp_path: Path) -> None:
    """Its least-squares estimate is below zero every second time, and a model with a law that cannot be is not read."""
    options = replace(PLAIN, physical=physical)
    inertias = []
    for seed in range(3):
        log = run([partial(coupled, inertia=0.0)], seed)
        found = reconstruct([log], three_axis(), library="rigid-body", options=options)
        assert named(found) == [("transmission_coupling", 2, 3)]
        inertias.append(found.model.effects[0].parameters["inertia"].value)
        found.model.save(tmp_path / f"{seed}.json")
        load_model(tmp_path / f"{seed}.json")
    assert min(inertias) == 0.0


def test_a_spring_is_found_in_the_training_data() -> None:
    found = made([sprung])
    assert named(found) == [("joint_spring", 2, None)]
    check(found.model.effects[0], SPRING)


def test_the_energies_find_it_too() -> None:
    assert named(made([coupled], library="lagrangian")) == [("transmission_coupling", 2, 3)]


def rippled(motion: Motion) -> Array:
    """A hundred teeth: beyond the low-pass as soon as the joint turns with 0.6 rad/s."""
    return np.outer(0.3 * np.sin(100 * motion.q[:, 2] + 0.7), [0, 0, 1])


def test_a_ripple_beyond_the_low_pass_is_found() -> None:
    found = made([rippled])
    assert named(found) == [("torque_ripple", 3, None)]
    parameters = found.model.effects[0].parameters
    assert parameters["order"].value == 100
    check(found.model.effects[0], {"amplitude": 0.3, "phase": 0.7})


def cogging(motion: Motion) -> Array:
    """Eight poles, two periods of them in the travel of joint 2: the base parameters soak part of it up."""
    return np.outer(np.sin(8 * motion.q[:, 1] + 0.7), [0, 1, 0])


@pytest.mark.parametrize("library", ["rigid-body", "lagrangian"])
def test_a_ripple_of_low_order_is_fitted_together_with_the_rest(library: str) -> None:
    found = made([cogging], library=library)
    assert named(found) == [("torque_ripple", 2, None)]
    parameters = found.model.effects[0].parameters
    assert parameters["order"].value == 8
    check(found.model.effects[0], {"amplitude": 1.0, "phase": 0.7})
    assert parameters["amplitude"].std_error < 0.02
    # so nothing of it is left
    assert max(found.held_out.moving["nrmse"]) < 0.02


def test_a_ripple_of_a_motor_behind_a_gear_is_found_between_whole_orders() -> None:
    """Whole ones would need two, neither of which is there."""
    found = made([lambda motion: np.outer(np.sin(14.4 * motion.q[:, 1] + 0.7), [0, 1, 0])])
    assert named(found) == [("torque_ripple", 2, None)]
    parameters = found.model.effects[0].parameters
    assert parameters["order"].value == pytest.approx(14.4, abs=0.1)
    assert parameters["amplitude"].value == pytest.approx(1.0, abs=0.03)
    # read off what the model leaves, of which the base parameters have soaked up some
    assert np.isnan(parameters["order"].std_error) and np.isnan(parameters["phase"].std_error)
    assert max(found.held_out.moving["nrmse"]) < 0.02


def test_several_ripples_of_a_joint_are_found() -> None:
    def twice(motion: Motion) -> Array:
        return np.outer(
            np.sin(12 * motion.q[:, 2] + 0.7) + 0.6 * np.sin(40 * motion.q[:, 2] - 0.2), [0, 0, 1]
        )

    found = made([twice])
    assert named(found) == [("torque_ripple", 3, None)] * 2
    for added, truth in zip(
        found.model.effects,
        ({"amplitude": 1.0, "phase": 0.7}, {"amplitude": 0.6, "phase": -0.2}),
        strict=True,
    ):
        check(added, truth)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_what_is_broad_over_the_angle_is_no_ripple(seed: int) -> None:
    """A spring on one side, which no law of the catalogue is."""
    found = made([lambda motion: np.outer(20 * np.maximum(motion.q[:, 1] - 0.2, 0.0), [0, 1, 0])], seed)
    assert "torque_ripple" not in [name for name, *_ in named(found)]


def test_two_laws_are_both_found() -> None:
    found = made([sprung, coupled])
    assert sorted(named(found)) == [("joint_spring", 2, None), ("transmission_coupling", 2, 3)]


def test_a_nine_second_log_shows_a_coupling() -> None:
    assert named(made([coupled], seconds=9)) == [("transmission_coupling", 2, 3)]


def test_the_residual_alone_does_not_show_what_base_parameters_soak_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What a search of the residual would take the coupling for is a part of what it is."""
    whole = of_coupled(0).held_out.moving["nrmse"]
    monkeypatch.setattr(catalogue, "permanent", lambda arm: [])
    without = made([coupled])
    assert named(without) == []
    assert max(without.held_out.moving["nrmse"]) > 3 * max(whole)


def test_the_model_with_a_law_is_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is saved, read, predicts, drives; the terminal and the file name what was always there."""
    path, out = tmp_path / "run.csv", tmp_path / "model.json"
    write_log(path, run([coupled]))
    command = ["reconstruct", str(path), "--arm", "three_axis", "--library", "rigid-body", "--out", str(out)]
    assert main(command) == 0
    assert (
        "always there: a motor turns with the difference of the speeds of joints 2 and 3"
        in capsys.readouterr().out
    )
    data = json.loads(out.read_text())
    assert [(e["effect"], e["joint"], e["other_joint"], e["when"]) for e in data["effects"]] == [
        ("transmission_coupling", 2, 3, "always")
    ]
    model = load_model(out)
    assert model.effects[0].when == "always"
    motion = fourier_motion(2, 100, 7)
    bare = replace(model, effects=())
    np.testing.assert_allclose(
        (model.predict(motion) - bare.predict(motion))[100],
        model.effects[0].torque(model.context(motion))[100],
    )
    q, v, vdot = motion.q[100], motion.v[100], motion.vdot[100]
    extra = model.feedforward(q, v, vdot) - bare.feedforward(q, v, vdot)
    np.testing.assert_allclose(
        extra, model.effects[0].torque(model.context(motion))[100], rtol=1e-9, atol=1e-9
    )


class TestSearch:
    """Effects whose trials are given: by name, shape and what is chosen already."""

    @staticmethod
    def effect(
        name: str, complexity: int = 1, shapes: tuple[float, ...] = (0.0,), plausible: bool = True
    ) -> Any:
        return SimpleNamespace(
            place=(name, 1, None),
            **{"name": name, "joint": 1, "beside": ()},
            complexity=complexity,
            needs_model=False,
            periodic=False,
            passive=False,
            shapes=lambda context: shapes,
            fixed_refined=lambda coefficients, shape: shape,
            geared=lambda shape: (),
            estimates=lambda arm, coefficients, covariance, shape: (coefficients, shape),
            plausible=lambda arm, estimates: plausible and estimates == ("of it", shapes[-1]),
            label=lambda: name,
        )

    @staticmethod
    def trial(removed: float, share: float = 0.5, **of: Any) -> Any:
        judged = {"score": 99.0, "blocks": 9, "everywhere": True} | of
        return SimpleNamespace(removed=removed, share=share, coefficients="of it", covariance=None, **judged)

    def found(
        self,
        monkeypatch: pytest.MonkeyPatch,
        effects: list[Any],
        trials: Callable[[str, float, list[str]], Any],
    ) -> list[tuple[str, float, float]]:
        asked = []

        def columns(name: str, context: Any, shape: float) -> np.ndarray:
            asked.append((name, shape))
            return np.ones((1, 1, 2))

        for one in effects:
            one.fixed_columns = partial(columns, one.place[0])

        def bench(laws: Any) -> Any:
            taken = [law.effect.place[0] for law in laws]
            return SimpleNamespace(trial=lambda columns, new, worth: trials(*columns, taken))

        monkeypatch.setattr(catalogue, "permanent", lambda arm: effects)
        monkeypatch.setattr(catalogue, "_smoothed", lambda samples, columns: asked[-1])
        nothing: Any = None
        samples: Any = SimpleNamespace(motion=None, period=1.0)
        laws = catalogue.search(nothing, samples, bench, lambda text: None)
        assert laws.tried == len([e for e in effects if not e.needs_model])
        return [(law.effect.place[0], law.shape, law.gain) for law in laws.chosen]

    def test_the_simplest_of_those_that_remove_nine_tenths_of_the_most(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made = [self.effect("rich", 3), self.effect("plain", 1), self.effect("even", 1)]
        for plain, best in ((90.0, "even"), (89.0, "even"), (92.0, "plain")):
            removed = {"rich": 100.0, "plain": plain, "even": 91.0}
            found = self.found(
                monkeypatch,
                made,
                lambda name, shape, taken, of=removed: None if taken else self.trial(of[name]),
            )
            assert found == [(best, 0.0, 0.5)]
        removed = {"rich": 100.0, "plain": 90.0, "even": 80.0}
        first = self.found(
            monkeypatch, made, lambda name, shape, taken: None if taken else self.trial(removed[name])
        )
        assert first == [("plain", 0.0, 0.5)]
        removed["plain"] = 89.0
        first = self.found(
            monkeypatch, made, lambda name, shape, taken: None if taken else self.trial(removed[name])
        )
        assert first == [("rich", 0.0, 0.5)]

    def test_one_after_the_other_at_most_six_each_once(self, monkeypatch: pytest.MonkeyPatch) -> None:
        made = [self.effect(name) for name in "abcdefgh"]
        found = self.found(
            monkeypatch, made, lambda name, shape, taken: self.trial(ord(name), len(taken) + 1.0)
        )
        assert found == [(name, 0.0, k + 1.0) for k, name in enumerate("hgfedc")]

    def test_the_shape_that_removes_most_of_at_most_eight(self, monkeypatch: pytest.MonkeyPatch) -> None:
        eight = tuple(float(k) for k in range(8))
        made = [self.effect("eight", 1, eight), self.effect("nine", 1, (*eight, 8.0))]
        trials = lambda name, shape, taken: None if shape == 0 else self.trial(shape)  # noqa: E731
        assert self.found(monkeypatch, made, trials) == [("eight", 7.0, 0.5)]

    def test_orders_come_from_the_peaks_and_those_beside_them(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Of hundreds; a joint may have several, and chance has as many tries as there are orders."""
        made = [self.effect("wave", 1, tuple(float(k) for k in range(4, 104)))]
        made[0].periodic, made[0].joint = True, 2
        made[0].plausible = lambda arm, estimates: True
        peaks = {0: [7.0, 4.0], 1: [50.0], 2: []}
        asked, judged = [], [0.0]

        made[0].fixed_columns = lambda context, shape: np.full((1, 1, 2), shape)
        motion = SimpleNamespace(q=np.arange(6.0).reshape(3, 2))
        samples: Any = SimpleNamespace(motion=motion, period=0.1)

        def bench(laws: Any) -> Any:
            def trial(columns: np.ndarray, new: float, worth: float) -> Any:
                shape = float(columns[0, 0, 0])
                asked.append(shape)
                return self.trial(10.0 if shape in (6.0, 50.0) else 5.0, score=judged[0])

            def left(joint: int) -> Any:
                assert joint == 1
                return np.array([0, 2]), np.array([len(laws) + 0.0, 9.0]), np.array([0, 1])

            return SimpleNamespace(trial=trial, left=left)

        def lines(q: Any, left: Any, orders: Any, worth: float) -> Any:
            assert q.tolist() == [1.0, 5.0] and orders == list(made[0].shapes(None)) and worth == 0.05
            return peaks[int(left[0])]

        monkeypatch.setattr(catalogue, "permanent", lambda arm: made)
        monkeypatch.setattr(catalogue, "Context", lambda arm, motion, period: SimpleNamespace(motion=motion))
        monkeypatch.setattr(catalogue, "_smoothed", lambda samples, columns: columns)
        monkeypatch.setattr(catalogue, "lines", lines)
        monkeypatch.setattr(catalogue, "between", lambda q, left, peak, blocks: peak + 0.1 * (blocks - 2))
        nothing: Any = None
        # Student's t of eight degrees of freedom: 8.906 in a hundred thousand cases, 4.501 in a thousand
        for score, found in ((8.91, [(6.0, 100), (50.0, 100)]), (8.90, [])):
            judged[0] = score
            laws = catalogue.search(nothing, samples, bench, lambda text: None)
            assert [(law.shape, law.among) for law in laws.chosen] == found and laws.tried == 1
        assert asked == [4.0, 5.0, 6.0, 7.0, 8.0, 49.0, 50.0, 51.0, 4.0, 5.0, 6.0, 7.0, 8.0]

    def test_it_must_be_plausible_and_its_coefficients_its_parameters(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made = [self.effect("impossible", plausible=False), self.effect("asks")]
        made[1].needs_model = True
        assert self.found(monkeypatch, made, lambda name, shape, taken: self.trial(1.0)) == []

    def test_it_must_remove_more_than_chance_among_so_many_everywhere(self) -> None:
        # Student's t of four degrees of freedom exceeds 13.0337 in one of ten thousand cases, of eight 4.5008 in a thousand
        worth = catalogue.is_worth
        assert worth(self.trial(1.0, score=13.04, blocks=5), 10) and worth(self.trial(1.0, score=4.51), 1)
        assert not worth(self.trial(1.0, score=13.03, blocks=5), 10) and not worth(
            self.trial(1.0, score=4.5), 1
        )
        assert worth(self.trial(1.0, 0.051), 10) and not worth(self.trial(1.0, 0.05), 10)
        assert not worth(self.trial(1.0, everywhere=False), 10)
        assert not worth(self.trial(1.0, score=0.0, blocks=1), 10)  # one block tells nothing

    def test_what_the_others_leave_nothing_to_goes_the_last_first(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(
            catalogue.Laws, "columns", lambda self, arm, samples: self.chosen[0].effect.place[0]
        )
        chosen = [catalogue.Law(self.effect(name), 0.0, 1) for name in "abc"]
        nothing: Any = None

        def left(of: Callable[[str, list[str]], Any]) -> str:
            def bench(laws: Any) -> Any:
                return SimpleNamespace(trial=lambda name: of(name, [law.effect.place[0] for law in laws]))

            return "".join(
                law.effect.place[0]
                for law in catalogue.pruned(catalogue.Laws(chosen, 10), bench, nothing, nothing).chosen
            )

        assert left(lambda name, others: self.trial(1.0)) == "abc"
        assert left(lambda name, others: None if name == "b" else self.trial(1.0)) == "ac"
        # b and c stand for each other: the later goes
        assert (
            left(lambda name, others: None if {"b", "c"} & set(others) and name in "bc" else self.trial(1.0))
            == "ab"
        )
        assert left(lambda name, others: self.trial(1.0, 0.05 if name == "a" else 0.5)) == "bc"
        assert left(lambda name, others: None) == ""

    def test_what_acts_alike_on_several_joints_is_filtered_once(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        x = np.arange(6.0).reshape(3, 2)
        raw = np.stack([0 * x, x, -x, 2 * x, x], axis=1)
        filtered: list[int] = []

        def smooth(samples: Any, columns: np.ndarray) -> np.ndarray:
            filtered.append(len(columns))
            return columns + 1

        monkeypatch.setattr(catalogue, "smooth", smooth)
        nothing: Any = None
        made = catalogue._smoothed(nothing, raw)
        np.testing.assert_array_equal(made, np.stack([0 * x, x + 1, -x - 1, 2 * x + 1, x + 1], axis=1))
        assert len(filtered) == 2


def differential(motion: Motion, inertias: tuple[float, float], viscous: tuple[float, float]) -> Array:
    """Two motors, of the sum and of the difference of v2 and v3."""
    total = np.zeros((motion.samples, 3))
    for ratio, inertia, damping, dry in zip((1.0, -1.0), inertias, viscous, (0.8, 0.5), strict=True):
        w, rate = (x[:, 1] + ratio * x[:, 2] for x in (motion.v, motion.vdot))
        total += np.outer(inertia * rate + damping * w + dry * np.sign(w), [0, 1, ratio])
    return total


@pytest.mark.parametrize(
    ("inertias", "viscous"),
    [((0.05, 0.05), (0.4, 0.4)), ((0.02, 0.1), (0.6, 0.2))],
    ids=["alike", "unlike"],
)
def test_two_motors_of_a_wrist_are_found_together(
    inertias: tuple[float, float], viscous: tuple[float, float], tmp_path: Path
) -> None:
    """By itself neither is: the other one's friction would be a damping below zero."""
    found = made([partial(differential, inertias=inertias, viscous=viscous)])
    assert named(found) == [("transmission_coupling", 2, 3)] * 2
    motors = {added.parameters["ratio"].value: added for added in found.model.effects}
    check(motors[1.0], {"coulomb": 0.8})
    check(motors[-1.0], {"coulomb": 0.5})
    # what both have in common may be each joint's own, or the rotors'
    for name, truth in (("inertia", inertias), ("viscous", viscous)):
        one, other = (motors[ratio].parameters[name] for ratio in (1.0, -1.0))
        error = np.hypot(one.std_error, other.std_error)
        assert abs(one.value - other.value - (truth[0] - truth[1])) < 4 * error + 0.02 * max(truth), name
    assert max(found.held_out.moving["nrmse"]) < 0.05
    found.model.save(tmp_path / "model.json")
    assert len(load_model(tmp_path / "model.json").effects) == 2
