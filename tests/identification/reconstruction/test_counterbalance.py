"""What a spring pulls once a turn is told from a weight where a first moment's inertia contradicts it, and only there."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import fourier_motion, friction, measured, rigid_torque

from armloop.data.motion import Motion
from armloop.dynamics import Dynamics
from armloop.identification.reconstruction import Options, catalogue, reconstruct
from armloop.identification.reconstruction.companions import accompanied, companions, is_there
from armloop.laws.effects import Context, Estimate, effect
from armloop.model import ReconstructedModel
from armloop.robot.arm import Arm, load_arm

Array = NDArray[np.float64]
#: N; m from the axis on either link; rad.
FORCE, NEAR, FAR, DEAD_CENTRE = 60.0, 0.1, 0.25, 0.2
LAW = effect("counterbalance", 2)


def by_levers(angle: Array) -> Array:
    """Torque of a gas spring of a constant force between two points."""
    angle = angle - DEAD_CENTRE
    length = np.sqrt(NEAR**2 + FAR**2 - 2 * NEAR * FAR * np.cos(angle))
    return FORCE * NEAR * FAR * np.sin(angle) / length


def of_the_angle(angle: Array) -> Array:
    """Torque of a spring about the axis."""
    return 10 * (angle - 0.1)


@pytest.fixture(scope="module")
def arm(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Arm:
    """The three-axis arm with its shoulder 15 cm beside the first axis, which turns the first moment of the second link."""
    text = (repository / "urdf" / "three_axis.urdf").read_text(encoding="utf-8")
    before, after = text.split('<joint name="joint_2"')
    path = tmp_path_factory.mktemp("arm") / "beside.urdf"
    path.write_text(
        f'{before}<joint name="joint_2"{after.replace("0 0 0.2", "0.15 0 0.2", 1)}', encoding="utf-8"
    )
    return load_arm(path)


def made(arm: Arm, seed: int, spring: Any) -> tuple[ReconstructedModel, list[str], Motion]:
    motion = fourier_motion(60, 100, seed, arm)
    tau = rigid_torque(arm, motion.q, motion.v, motion.vdot) + friction(motion.v)
    tau[:, 1] += spring(motion.q[:, 1])
    options = Options(standard_errors=False, parts=False)
    result = reconstruct([measured(motion, tau, seed)], arm, library="rigid-body", options=options)
    return result.model, result.notes, motion


def inertia(arm: Arm, q: Array) -> Array:
    """(N, n, n) M(q) of the arm's nominal links."""
    still = np.zeros_like(q)
    columns = [rigid_torque(arm, q, still, still + row) for row in np.eye(arm.n)]
    return np.stack(columns, axis=2) - rigid_torque(arm, q, still, still)[:, :, None]


@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.long)]
)
def test_a_gas_spring_is_no_mass(arm: Arm, seed: int) -> None:
    model, notes, motion = made(arm, seed, by_levers)
    assert {a.effect.place for a in model.effects} == {
        ("spring_balancer", 2, None),
        ("counterbalance", 2, None),
    }
    assert any("pulls once a turn, as a weight does" in note and "removes" not in note for note in notes)
    q = motion.q[::100]
    M = np.array([Dynamics(model).mass_matrix(each) for each in q])
    joint_2 = inertia(arm, q)[:, 1, 1]
    assert np.sqrt(np.mean((M[:, 1, 1] - joint_2) ** 2)) < 0.01 * np.sqrt(np.mean(joint_2**2))


def test_a_spring_about_the_axis_has_none(arm: Arm) -> None:
    model, _, _ = made(arm, 0, of_the_angle)
    assert [a.effect.place for a in model.effects] == [("joint_spring", 2, None)]


def test_it_stands_beside_springs_of_its_joint_alone() -> None:
    def law(name: str, joint: int) -> Any:
        return SimpleNamespace(effect=effect(name, joint))

    assert companions([law("rotor_inertia", 1), law("torque_ripple", 2)]) == []
    found = companions([law("joint_spring", 3), law("spring_balancer", 3), law("spring_balancer", 1)])
    assert [one.place for one in found] == [("counterbalance", 3, None), ("counterbalance", 1, None)]
    assert accompanied(found[0], [law("joint_spring", 3)])
    assert not accompanied(found[0], [law("joint_spring", 1)])
    assert not accompanied(found[0], [law("torque_ripple", 3)])


def test_it_is_there_if_its_coefficients_are() -> None:
    def trial(coefficient: float, blocks: int = 40, correlation: float = 0.0) -> Any:
        covariance = np.array([[1.0, correlation], [correlation, 1.0]])
        return SimpleNamespace(
            coefficients=np.array([coefficient, 0.0]), covariance=covariance, blocks=blocks
        )

    # of 40 blocks T² passes 16.8 once in a thousand times
    assert is_there(trial(4.2)) and not is_there(trial(4.0))
    assert is_there(trial(4.0, correlation=0.5))
    assert not is_there(trial(4.2, blocks=10)) and not is_there(trial(1e9, blocks=2))
    assert not is_there(None)


def test_one_without_its_spring_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = [catalogue.Law(effect(name, 2), 0.0, 2) for name in ("joint_spring", "counterbalance")]
    monkeypatch.setattr(catalogue.Laws, "columns", lambda self, arm, samples: self.chosen[0].effect.name)
    nothing: Any = None

    def left(worth: dict[str, Any]) -> list[str]:
        def bench(laws: Any) -> Any:
            return SimpleNamespace(trial=worth.__getitem__)

        return [
            law.effect.name
            for law in catalogue.pruned(catalogue.Laws(kept, 10), bench, nothing, nothing).chosen
        ]

    there: Any = SimpleNamespace(coefficients=np.array([9.0, 0.0]), covariance=np.eye(2), blocks=40)
    spring: Any = SimpleNamespace(share=0.5, score=99.0, blocks=40, everywhere=True)
    assert left({"joint_spring": spring, "counterbalance": there}) == ["joint_spring", "counterbalance"]
    assert left({"joint_spring": spring, "counterbalance": None}) == ["joint_spring"]
    assert left({"joint_spring": None, "counterbalance": there}) == []


def test_its_parameters_are_those_of_its_columns() -> None:
    q = np.linspace(-1.0, 1.5, 40)[:, None] * [0.3, 1.0, -0.5]
    context = Context(load_arm("three_axis"), Motion(np.arange(40.0), q, 0 * q, 0 * q, np.array([0])))
    (shape,) = LAW.shapes(context)
    x = np.array([3.0, -4.0])
    found = LAW.estimates(context.arm, x, 0.01 * np.eye(2), shape)
    values = {key: e.value for key, e in found.items()}
    np.testing.assert_allclose(LAW.torque(context, values), LAW.full_columns(context, shape) @ x, atol=1e-12)
    assert values["amplitude"] == pytest.approx(5.0) and found["amplitude"].std_error == pytest.approx(0.1)
    words = LAW.sentence({**found, "amplitude": Estimate(5.0, 0.1, "N*m")})
    assert "5.00 ± 0.10 N*m" in words and "no part of the first moments" in words


@pytest.mark.parametrize("there", [True, False])
def test_one_whose_spring_no_arm_has_goes_with_it(there: bool) -> None:
    kept = [catalogue.Law(effect(name, 2), 0.0, 2) for name in ("joint_spring", "counterbalance")]
    # a spring that pushes is none
    x = np.array([5.0 if there else -5.0, 0.1, 3.0, 4.0])
    found = catalogue.Laws(kept, 10).possible(load_arm("three_axis"), x, 1e-4 * np.eye(4))
    assert [law.effect.name for law in found.chosen] == (["joint_spring", "counterbalance"] if there else [])
