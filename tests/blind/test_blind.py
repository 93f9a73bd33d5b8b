"""A small fixed part of the blind test; `make blind` runs a few hundred cases."""

from __future__ import annotations

import ast
import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

HERE = Path(__file__).parent
# Scripts that import each other by name, as they do when they are run.
sys.path.insert(0, str(HERE))

import generate as generate_module  # noqa: E402
import loops  # noqa: E402
from generate import generate  # noqa: E402
from hidden import NOT_DRAWN, REALISED, Run, _sized  # noqa: E402
from judge import LARGE, Case, is_right, of_changes  # noqa: E402
from run import judge  # noqa: E402

from armloop.data.log import read_log  # noqa: E402
from armloop.drake.experiments.scenarios import load_plan  # noqa: E402
from armloop.drake.plant.friction import JointFriction  # noqa: E402
from armloop.experiment.excitation import MotionRanges, fourier_reference  # noqa: E402
from armloop.identification.reconstruction import reconstruct  # noqa: E402
from armloop.robot.arm import load_arm  # noqa: E402


@pytest.fixture(
    scope="module",
    params=[
        # the first run of the first arm in which nothing is hidden, and the first in which something large is
        pytest.param(((1,), (1, 3), "quick"), marks=pytest.mark.slow),
        pytest.param(((1, 2), range(6), "paper"), marks=pytest.mark.long),
    ],
    ids="arms, runs and plan {0[0]} {0[1]} {0[2]}".format,
)
def cases(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Case]:
    """Verdicts on logs beside which no answer is left: those are read and removed before the first diagnosis."""
    place = tmp_path_factory.mktemp("blind")
    arms, runs, plan = request.param
    sealed: dict[str, dict[str, Any]] = {}
    with pytest.MonkeyPatch.context() as patch:
        if plan == "quick":  # runs of 30 s instead of 50
            patch.setattr(generate_module, "DURATION", 30.0)
        for seed in arms:
            generate(seed, runs, load_plan(plan), place / "logs", place / "answers")
    for path in (place / "answers").glob("*.json"):
        sealed[path.stem] = json.loads(path.read_text(encoding="utf-8"))
    shutil.rmtree(place / "answers")
    verdicts: dict[str, dict[str, Any]] = {}
    if plan == "quick":  # of one library, instead of the best of all
        for folder in (place / "logs").iterdir():
            logs = [read_log(path) for path in sorted(folder.glob("baseline_*.csv"))]
            arm = load_arm(folder / "arm.urdf")
            reconstruct(logs, arm, library="rigid-body").model.save(folder / "model.json")
    for seed in arms:
        verdicts |= judge(place / "logs" / f"arm_{seed}", place / f"verdicts_{seed}.json")
    assert verdicts.keys() == sealed.keys()
    return {name: (sealed[name], verdict) for name, verdict in verdicts.items()}


def test_verdicts_are_right_without_the_answers(cases: dict[str, Case]) -> None:
    large = {k: c for k, c in cases.items() if min(c[0]["sizes"], default=1.0) >= LARGE}
    wrong = {k: (c[0]["effects"], c[1]) for k, c in large.items() if not is_right(*c)}
    assert len(large) >= len(cases) // 2
    assert len(wrong) <= len(large) // 6, wrong


def test_no_false_alarms(cases: dict[str, Case]) -> None:
    clean = [verdict for hidden, verdict in cases.values() if hidden["kind"] == "clean"]
    assert all(verdict["verdict"] == "no_effect" for verdict in clean)


@pytest.mark.long
def test_creep_into_points_is_no_friction_that_came(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A clean run that goes from point to point, and a model of sines and sweeps, of an arm from an engine of its own."""
    pytest.importorskip("mujoco", reason="mujoco is needed for tests only; it is in requirements-test.lock")
    monkeypatch.syspath_prepend(str(HERE.parent))
    from outside_generate import generate_outside

    generate_outside(509, 1, tmp_path / "logs", tmp_path / "answers", points=True)
    (verdict,) = judge(tmp_path / "logs" / "outside_509", tmp_path / "verdict.json").values()
    assert verdict["verdict"] == "no_effect", verdict["effects"]
    assert any("slower than it was trained at" in reason for reason in verdict["reasons"])


@pytest.mark.parametrize("name", [name for name in REALISED if name not in NOT_DRAWN])
def test_every_effect_of_a_plant_can_be_hidden_at_a_size(name: str) -> None:
    """At one of a few places at least, with the parameters that the plant takes."""
    arm, friction = load_arm("three_axis"), JointFriction(0.6, 0.5, 0.1, 0.3)
    ranges = MotionRanges(*(np.full(3, x) for x in (-1.0, 1.0, 1.5, 5.0)))
    run = Run.of(arm, [friction] * arm.n, fourier_reference(ranges, 20.0, 1, harmonics=5))
    drawn = [_sized(run, name, 0.1, np.random.default_rng(seed)) for seed in range(8)]
    found = [each for each in drawn if each is not None]
    assert found and all(each.name == name for each in found)
    # a delay is scaled as if its torque were in proportion to it
    assert all(0.03 < run.size(each) < 0.3 for each in found), [run.size(each) for each in found]


def test_of_a_measured_arm_what_its_model_lacks_all_along_is_not_judged() -> None:
    def found(*effects: tuple[str, str]) -> dict[str, Any]:
        listed = [{"effect": name, "joint": 1, "when": when, "alternatives": []} for name, when in effects]
        return {"verdict": "effects_found", "effects": listed}

    memory, drag, law = ("presliding", "always"), ("drag", "changed"), ("unlisted", "changed")
    clean = {"kind": "clean", "effects": [], "measured": "an arm"}
    one = {"kind": "one", "effects": [{"name": "drag", "joint": 1}], "measured": "an arm"}
    unlisted = {"kind": "unlisted", "effects": [], "measured": "an arm"}
    assert is_right(*of_changes((clean, found(memory))))
    assert is_right(*of_changes((one, found(memory, drag)))) and is_right(
        *of_changes((unlisted, found(law, memory)))
    )
    assert not is_right(*of_changes((clean, found(memory, drag))))
    # of a simulated arm it is known
    assert not is_right(*of_changes(({**clean, "measured": None}, found(memory))))


def test_finished_loops_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = tmp_path / "made"

    def run(arm: str, seed: int, clean: bool) -> loops.Case:
        with made.open("a") as file:
            file.write(f"{seed} ")
        if seed == 3 and made.read_text().split().count("3") == 1:
            raise KeyboardInterrupt
        return loops.Case(seed, "nothing", "nothing", True, "", 1.0, 1.0)

    run.__module__, run.__qualname__ = loops.__name__, "run"  # as the processes look for it
    monkeypatch.setattr(loops, "run", run)
    monkeypatch.setattr(
        sys, "argv", ["loops.py", "--seeds", "3", "--clean", "0", "--keep", str(tmp_path / "k")]
    )
    with pytest.raises(KeyboardInterrupt):
        loops.main()
    assert loops.main() == 0
    assert sorted(made.read_text().split()) == ["1", "2", "3", "3"]


def test_what_is_left_out_rule_by_rule_is_there() -> None:
    import ablate

    gone = [
        (rule.name, name) for rule in ablate.RULES for place, name in rule.places if not hasattr(place, name)
    ]
    assert gone == []


def test_the_judging_process_imports_nothing_of_the_generator() -> None:
    tree = ast.parse((HERE / "verdicts.py").read_text(encoding="utf-8"))
    names = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names |= {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    own = {path.stem for path in HERE.glob("*.py")}
    assert not {str(name).split(".")[0] for name in names} & own
    assert not any("armloop.drake" in str(name) for name in names)
