"""A user's own effects: found under their names, refused in one line where they are none."""

import sys
from pathlib import Path

import numpy as np
import pytest
from exact_parts import model_of
from pydrake.systems.analysis import Simulator
from synthetic import fourier_motion, three_axis

from armloop.data.motion import Motion
from armloop.drake.experiments.speed_mode import SpeedModeArm
from armloop.drake.plant.config import Instruments
from armloop.drake.plant.fault_injection import UndeclaredEffect, realise
from armloop.dynamics import Dynamics, effect_law
from armloop.experiment.excitation import FourierReference
from armloop.export.formula import formula
from armloop.laws.effects import (
    INERTIA,
    REGISTRY,
    Context,
    Effect,
    Element,
    Law,
    LinearJointEffect,
    Parameter,
    ProfiledJointEffect,
    effect,
    hypotheses,
    register,
)
from armloop.util.errors import InputError, ModelError, ScenarioError
from armloop.util.functions import MATH


class Cubic(LinearJointEffect):
    name = "cubic_drag"
    parameter, unit, law = "coefficient", "TAU*s^3/POS^3", "c v^3"

    def column(self, motion, joint):
        return motion.v[:, joint] ** 3


class Flywheel(LinearJointEffect):
    name = "flywheel"
    parameter, unit, law = "inertia", "INERTIA", "I vdot"

    def column(self, motion, joint):
        return motion.vdot[:, joint]


class Unknown(LinearJointEffect):
    name = "recorded_twice"
    sensor = True
    parameter, unit, law = "level", "TAU", "b v"

    def column(self, motion, joint):
        return motion.v[:, joint]


class Smoothed(ProfiledJointEffect):
    name = "smoothed_step"
    parameter, unit, law = "level", "TAU", "c tanh(v/s)"
    shape_name, shape_unit = "speed", "POS/s"

    def column(self, motion, joint, *shape):
        return np.tanh(motion.v[:, joint] / shape[0])

    def shapes(self, context):
        return [0.1, 0.2, 0.4]


@pytest.fixture(autouse=True)
def nothing_left_behind():
    """Every test begins and ends without a registered effect."""
    REGISTRY.forget()
    yield
    REGISTRY.forget()


def install(folder: Path, monkeypatch, module: str, entries: dict[str, str], code: str) -> None:
    """A package as an installer leaves it, on the path."""
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(code)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    lines = "".join(f"{name} = {value}\n" for name, value in entries.items())
    (info / "entry_points.txt").write_text(f"[armloop.effects]\n{lines}")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, module, raising=False)
    REGISTRY.forget()


CODE = """
from armloop.laws.effects import LinearJointEffect
class Own(LinearJointEffect):
    name = "own_drag"
    parameter, unit, law = "coefficient", "TAU*s^3/POS^3", "c v^3"
    def column(self, motion, joint):
        return motion.v[:, joint] ** 3
"""


def test_a_registered_effect_is_a_hypothesis_at_every_joint_and_built_by_name():
    before = len(hypotheses(three_axis()))
    assert register(Cubic) is Cubic and REGISTRY.own_names() == ["cubic_drag"]
    labels = [h.label() for h in hypotheses(three_axis())]
    assert labels[before:] == [f"cubic_drag at joint {j}" for j in (1, 2, 3)]
    assert isinstance(effect("cubic_drag", 2), Cubic)
    register(Cubic)  # a cell that runs twice
    with pytest.raises(ModelError, match="joint must be a number"):
        effect("cubic_drag", None)


def test_an_installed_effect_is_loaded_when_it_is_asked_for(tmp_path, monkeypatch):
    install(tmp_path / "a", monkeypatch, "own_package_a", {"own_drag": "own_package_a:Own"}, CODE)
    effect("viscous_friction", 1)
    assert REGISTRY.own_names() == ["own_drag"] and "own_package_a" not in sys.modules
    assert effect("own_drag", 3).label() == "own_drag at joint 3"
    assert set(REGISTRY.own()) == {"own_drag"}
    with pytest.raises(InputError, match="'own_drag' is taken by effect 'own_drag' of package own_package_a"):
        register(type("Drag", (Cubic,), {"name": "own_drag"}))


class Thinning(Law):
    name = "thinning_oil"
    parameters = (
        Parameter("coefficient", "TAU*s/POS", positive=True),
        Parameter("time_constant", "s", above=0.0, shape="continuous"),
    )
    law = "c exp(-t/T) v"
    elements = (Element(lambda x, p, f: f.exp(-(x.t / p)) * x.v, "exp(-t/{p:g})*v{j}"),)


def test_that_a_law_depends_on_the_time_follows_from_its_elements():
    """So that no list of such laws by name stands elsewhere: the formulas that are exported take the time."""
    register(Thinning)
    assert Thinning.of_time and Thinning.memory and not Seal.of_time and not Seal.memory
    model = model_of(three_axis(), effects=(("thinning_oil", 2, {"coefficient": 0.3, "time_constant": 5.0}),))
    found = formula(model)
    assert found.fades and found.has_memory and found.torque[1] is not found.remembered[1]


def test_two_packages_with_one_name_are_told_apart_by_nobody(tmp_path, monkeypatch):
    install(tmp_path / "a", monkeypatch, "own_package_a", {"own_drag": "own_package_a:Own"}, CODE)
    install(tmp_path / "b", monkeypatch, "own_package_b", {"own_drag": "own_package_b:Own"}, CODE)
    with pytest.raises(InputError, match="has the same name; uninstall one of the two"):
        hypotheses(three_axis())


@pytest.mark.parametrize(
    ("entries", "code", "says"),
    [
        ({"own_drag": "own_package_c:Own"}, "import no_such_thing", "cannot be loaded: ModuleNotFoundError"),
        ({"own_drag": "own_package_c:Missing"}, CODE, "cannot be loaded: AttributeError"),
        (
            {"own_drag": "own_package_c:Own"},
            "Own = 3",
            "is 3; it must be a subclass of armloop.laws.effects.Effect",
        ),
        ({"other_drag": "own_package_c:Own"}, CODE, "calls itself 'own_drag'; give both one name"),
        ({"payload": "own_package_c:Own"}, CODE, "'payload' is that of a listed effect"),
        ({"own_drag": "own_package_c:Own"}, CODE.replace("parameter, unit", "x, unit"), "lacks parameter"),
    ],
)
def test_a_package_that_is_at_fault_is_named_in_one_line(tmp_path, monkeypatch, entries, code, says):
    install(tmp_path / "c", monkeypatch, "own_package_c", entries, code)
    with pytest.raises(InputError, match=re_escape(says)) as caught:
        hypotheses(three_axis())
    assert "package own_package_c" in str(caught.value) and "\n" not in str(caught.value)
    # what does not need it is not hindered
    assert effect("coulomb_friction", 1).joint == 1


def re_escape(text: str) -> str:
    return text.replace(".", r"\.")


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (int, "must be a subclass"),
        (Effect, "lacks name, columns"),
        (type("Taken", (Cubic,), {"name": "payload"}), "'payload' is that of a listed effect"),
        (type("Spoken", (Cubic,), {"name": "Eddy brake"}), "lower-case letters"),
        (type("Pair", (Cubic,), {"pair_wise": True, "joint_wise": False}), "set joint_wise"),
    ],
)
def test_what_is_no_effect_is_not_registered(kind, says):
    with pytest.raises(InputError, match=says):
        register(kind)
    assert not REGISTRY.own_names()


def test_an_effect_without_parameters_says_itself_what_it_estimates():
    made = {key: lambda *_: None for key in Effect.__abstractmethods__}
    with pytest.raises(InputError, match="lacks parameters"):
        register(type("Bare", (Effect,), {"name": "bare", "parameters": (), **made}))
    named = {"name": "bare", "parameters": (), "estimates": lambda *_: {}}
    register(type("Bare", (Effect,), {**made, **named}))
    assert REGISTRY.own_names() == ["bare"]


def test_an_unknown_effect_says_what_to_do():
    register(Cubic)
    with pytest.raises(ModelError, match=r"unknown effect 'eddy'; install the package .* own: cubic_drag"):
        effect("eddy", 1)


def test_a_model_with_it_predicts_feeds_forward_and_has_equations():
    register(Cubic)
    register(Flywheel)
    added = (("cubic_drag", 2, {"coefficient": 0.4}), ("flywheel", 3, {"inertia": 0.05}))
    with_it, without = model_of(three_axis(), effects=added), model_of(three_axis())
    motion = fourier_motion(4.0, 20.0, seed=2)
    expected = np.zeros_like(motion.q)
    expected[:, 1] = 0.4 * motion.v[:, 1] ** 3
    expected[:, 2] = 0.05 * motion.vdot[:, 2]
    np.testing.assert_allclose(with_it.predict(motion) - without.predict(motion), expected, atol=1e-12)
    states = list(zip(motion.q, motion.v, motion.vdot, strict=True))
    supplied = [with_it.feedforward(*x) - without.feedforward(*x) for x in states]
    np.testing.assert_allclose(supplied, expected, atol=1e-12)
    own_dynamics, bare = Dynamics(with_it), Dynamics(without)
    torques = [d.torque(motion.q, motion.v, motion.vdot) for d in (own_dynamics, bare)]
    np.testing.assert_allclose(torques[0] - torques[1], expected, atol=1e-9)
    more = own_dynamics.mass_matrix(motion.q) - bare.mass_matrix(motion.q)
    np.testing.assert_allclose(more, np.broadcast_to(np.diag([0, 0, 0.05]), more.shape), atol=1e-12)


def test_a_sensors_effect_comes_after_the_listed_ones_and_no_controller_supplies_it():
    register(Unknown)
    with_it = model_of(
        three_axis(), effects=(("torque_gain", 1, {"gain": 1.1}), ("recorded_twice", 1, {"level": 0.3}))
    )
    without = model_of(three_axis())
    motion = fourier_motion(4.0, 20.0, seed=2)
    true = without.predict(motion)
    np.testing.assert_allclose(with_it.predict(motion)[:, 0], 1.1 * true[:, 0] + 0.3 * motion.v[:, 0])
    x = motion.q[0], motion.v[0], motion.vdot[0]
    np.testing.assert_allclose(with_it.feedforward(*x), without.feedforward(*x))
    with pytest.raises(ModelError, match="falsifies the record"):
        effect_law(three_axis(), "recorded_twice", 1, {"level": 0.3}, MATH)


def test_symbols_are_refused_in_one_line():
    from pydrake.symbolic import Variable

    register(Cubic)
    law = effect_law(three_axis(), "cubic_drag", 1, {"coefficient": 1.0}, MATH)
    speeds = [Variable("v") + 0.0, 0.0, 0.0]
    with pytest.raises(ModelError, match="plain numbers only, not for AutoDiffXd or Expression"):
        law.equations.rest([0.0] * 3, speeds)


class Seal(Law):
    """A lip seal: it holds a joint up to a level and drags on it."""

    name = "seal"
    parameters = (
        Parameter("level", "TAU", least=0.0),
        Parameter("drag", "TAU*s/POS", least=0.0),
        Parameter("inertia", "INERTIA", least=0.0),
    )
    law = "f sign(v) + c v^3 + I vdot"
    elements = ("sign", Element(lambda x, p, f: x.v * x.v * x.v, "v{j}^3"), INERTIA)


SEAL = {"level": 0.6, "drag": 0.2, "inertia": 0.03}


def test_a_law_of_elements_has_all_scalar_types():
    from pydrake.autodiffutils import AutoDiffXd
    from pydrake.symbolic import Expression, Variable

    from armloop.drake import EffectTorque_

    register(Seal)
    v, vdot = [0.7, -1.1, 0.4], [0.3, 0.2, -0.9]
    torque = 0.6 * np.tanh(-110) + 0.2 * (-1.1) ** 3 + 0.03 * 0.2
    for T, number in (
        (float, float),
        (AutoDiffXd, lambda x: AutoDiffXd(x, np.eye(3)[1])),
        (Expression, Expression),
    ):
        system = EffectTorque_[T](three_axis(), "seal", 2, SEAL)
        context = system.CreateDefaultContext()
        speeds = [number(x) for x in v]
        if T is Expression:
            speed = Variable("speed")
            speeds[1] = Expression(speed)
        system.GetInputPort("state").FixValue(context, [number(0.0)] * 3 + speeds)
        system.GetInputPort("vdot").FixValue(context, [T(x) for x in vdot])
        tau = system.GetOutputPort("tau").Eval(context)[1]
        if T is AutoDiffXd:
            assert tau.derivatives()[1] == pytest.approx(0.6 * (1 - np.tanh(110) ** 2) / 0.01 + 0.6 * 1.1**2)
            tau = tau.value()
        if T is Expression:
            tau = tau.Evaluate({speed: v[1]})
        assert float(tau) == pytest.approx(torque)


def test_the_plant_sticks_by_a_law_of_elements():
    from armloop.drake.plant.friction import JointFriction
    from armloop.drake.plant.plant import ArmPlant

    register(Seal)
    arm = three_axis()
    plant = ArmPlant(
        arm, (JointFriction(0.0, 0.0, 0.1, 0.0),) * 3, effects=[UndeclaredEffect("seal", 1, SEAL)]
    )
    for push, moves in ((0.55, False), (0.65, True)):
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()
        plant.set_state(context, np.array([0.3, -np.pi / 2, 0.0]), np.zeros(3))
        held = Dynamics(model_of(arm, friction=())).gravity(np.array([0.3, -np.pi / 2, 0.0]))
        plant.GetInputPort("tau").FixValue(context, held + np.array([push, 0.0, 0.0]))
        simulator.AdvanceTo(0.2)
        speed = plant.GetOutputPort("state").Eval(context)[3]
        assert (abs(speed) > 1e-2) == moves and (moves or abs(speed) < 1e-7)


def test_the_parameters_of_a_law_are_checked():
    register(Seal)
    for parameters, says in (
        ({"level": 0.1}, "parameters are level; they must be level, drag, inertia"),
        ({**SEAL, "drag": -1.0}, "drag is -1.0; it must not be negative"),
        ({**SEAL, "drag": "much"}, "drag is 'much'; it must be a number"),
    ):
        with pytest.raises(ScenarioError, match=says):
            UndeclaredEffect("seal", 1, parameters)


MOTION = FourierReference(
    np.array([0.2, -0.3, 0.5]),
    np.array([[0.5], [0.4], [0.6]]),
    np.array([[0.1], [0.3], [-0.4]]),
    np.array([[1.7], [2.1], [2.6]]),
    1.5,
)


def test_the_simulated_plant_can_have_it():
    from armloop.drake.plant.friction import JointFriction

    register(Cubic)
    friction = (JointFriction(0.0, 0.0, 0.1, 1.0),) * 3
    ideal = Instruments(encoder_counts=0, torque_noise=0.0)
    drag = UndeclaredEffect("cubic_drag", 2, {"coefficient": 0.8})
    runs = [
        SpeedModeArm(three_axis(), friction, effects=effects, instruments=ideal).follow(MOTION, settle=0.2)
        for effects in ([drag], [])
    ]
    expected = np.zeros_like(runs[0].q)
    expected[:, 1] = 0.8 * MOTION.evaluate(runs[0].time)[1][:, 1] ** 3
    np.testing.assert_allclose(runs[0].tau - runs[1].tau, expected, atol=5e-3)


def test_the_plant_refuses_what_it_cannot_have():
    for kind in (Cubic, Flywheel, Unknown):
        register(kind)
    register(type("Lazy", (Cubic,), {"name": "lazy_drag", "memory": True}))
    for name, joint, says in (
        ("recorded_twice", 1, "falsifies the record"),
        ("lazy_drag", 1, "depends on the past"),
        ("cubic_drag", None, "joint must be a number"),
        ("eddy", 1, "is unknown; the plant can have: .*cubic_drag"),
    ):
        with pytest.raises(ScenarioError, match=says):
            UndeclaredEffect(name, joint, {"level": 0.3})
    with pytest.raises(ScenarioError, match="depends on the acceleration"):
        realise(three_axis(), [UndeclaredEffect("flywheel", 1, {"inertia": 0.3})])
    with pytest.raises(ScenarioError, match=r"cubic_drag: has no torque .* parameters level \(KeyError"):
        realise(three_axis(), [UndeclaredEffect("cubic_drag", 1, {"level": 0.3})])


def test_a_torque_that_is_not_linear_in_the_acceleration_has_no_inertia():
    def square(self, motion: Motion, joint: int) -> np.ndarray:
        return motion.vdot[:, joint] ** 2

    register(type("Odd", (Cubic,), {"name": "odd", "column": square}))
    model = model_of(three_axis(), effects=(("odd", 1, {"coefficient": 1.0}),))
    with pytest.raises(ModelError, match="not linear in the acceleration"):
        Dynamics(model)


def test_one_sample_is_a_motion_of_its_own():
    seen = []

    class Seen(Cubic):
        def column(self, motion, joint):
            seen.append(motion)
            return super().column(motion, joint)

    law = Seen(2).pointwise(three_axis(), {"coefficient": 0.5}, None)
    q, v, vdot = np.arange(9.0).reshape(3, 3)
    assert law(q, v, vdot).tolist() == [0.0, 0.5 * v[1] ** 3, 0.0]
    (motion,) = seen
    assert motion.time.shape == (1,) and motion.starts.tolist() == [0]
    assert [x.tolist() for x in (motion.q, motion.v, motion.vdot)] == [
        [q.tolist()],
        [v.tolist()],
        [vdot.tolist()],
    ]


def test_a_profiled_effect_of_ones_own_has_a_positive_shape_with_a_value_between_those_tried():
    level, speed = Smoothed.parameters
    assert (level.name, level.unit, level.positive) == ("level", "TAU", True)
    assert (speed.name, speed.unit, speed.shape) == ("speed", "POS/s", "continuous")
    assert speed.fault(0.5) == "" and speed.fault(0.0) == "must be above 0" and Smoothed.complexity == 2
    arm, motion = three_axis(), fourier_motion(2.0, 100.0, 1)
    law, context = Smoothed(2), Context(arm, motion)
    x = motion.v[:, 1] / 0.2
    # the value, and the derivative by the logarithm of the shape, by a central difference of 0.03
    own = np.column_stack([np.tanh(x), -x / np.cosh(x) ** 2])
    np.testing.assert_allclose(law.columns(context, 0.2), own, atol=3e-4)
    # what is half of the level and a tenth more in log s
    found = law.estimates(arm, np.array([0.5, 0.05]), np.zeros((2, 2)), 0.2)
    values = {key: one.value for key, one in found.items()}
    assert values == pytest.approx({"level": 0.5, "speed": 0.2 * np.exp(0.1)})
    expected = np.zeros((motion.samples, 3))
    expected[:, 1] = 0.5 * np.tanh(motion.v[:, 1] / values["speed"])
    np.testing.assert_allclose(law.torque(context, values), expected, atol=1e-12)
