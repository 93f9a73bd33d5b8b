"""Friction terms add up to the law of Eq. (34), with the parameters read back."""

import numpy as np
import pytest

from armloop.data.motion import Motion
from armloop.laws.friction import (
    FRICTION_LAWS,
    KINDS,
    Acting,
    Direction,
    Element,
    FrictionLaw,
    FrictionTerm,
    Sliding,
    _entry,
    torque_along,
)
from armloop.util.errors import ModelError
from armloop.util.functions import MATH, NUMPY

FS, FC, FV, VS = 1.4, 0.9, 2.2, 0.12


def at_speeds(v, q=None):
    v = np.asarray(v, dtype=float)[:, None]
    q = np.zeros_like(v) if q is None else np.asarray(q, dtype=float)[:, None]
    return Motion(np.arange(float(len(v))), q, v, np.zeros_like(v), np.array([0]))


def stribeck_law():
    return FrictionLaw(
        ((FrictionTerm("sign", FS), FrictionTerm("stribeck", FC - FS, VS), FrictionTerm("viscous", FV)),)
    )


def test_sign_stribeck_and_viscous_terms_are_equation_34():
    v = np.concatenate([-np.geomspace(3, 1e-4, 50), [0.0], np.geomspace(1e-4, 3, 50)])
    expected = (FC + (FS - FC) * np.exp(-((v / VS) ** 2))) * np.sign(v) + FV * v
    np.testing.assert_allclose(stribeck_law().torque(at_speeds(v))[:, 0], expected, atol=1e-12)


def test_the_first_step_has_the_static_level_and_the_second_adds_the_rest():
    motion = at_speeds([-0.5, 0.001, 0.5])
    law = stribeck_law()
    np.testing.assert_allclose(law.torque(motion, step=1)[:, 0], FS * np.array([-1, 1, 1]))
    np.testing.assert_array_equal(law.torque(motion, step=2), law.torque(motion, step=3))
    # at a creep the second step changes next to nothing: it may be found later without touching the first
    assert law.torque(motion, step=2)[1, 0] == pytest.approx(FS, abs=0.003)


def test_the_parameters_of_equation_34_are_read_back():
    assert stribeck_law().stribeck_parameters(0) == pytest.approx(
        {"static": FS, "coulomb": FC, "stribeck_velocity": VS, "viscous": FV}
    )
    plain = FrictionLaw(((FrictionTerm("sign", 0.7),),))
    assert plain.stribeck_parameters(0) == {"static": 0.7, "coulomb": 0.7}
    assert FrictionLaw(((),)).stribeck_parameters(0) == {"static": 0.0, "coulomb": 0.0}
    falling = (
        FrictionTerm("smooth_sign", FC, 0.003),
        FrictionTerm("viscous", FV),
        FrictionTerm("stribeck_peak", FS - FC, VS),
    )
    assert FrictionLaw((falling,)).stribeck_parameters(0) == pytest.approx(
        stribeck_law().stribeck_parameters(0)
    )


@pytest.mark.parametrize(
    "others",
    [
        [FrictionTerm("smooth_sign", FC, 0.003)],
        [FrictionTerm("smooth_sign", FC, 0.5 * VS), FrictionTerm("stribeck_peak", FS, VS)],
        [
            FrictionTerm("sign", FC),
            FrictionTerm("stribeck_peak", FS, VS),
            FrictionTerm("stribeck_peak", FS, 9.0),
        ],
        [
            FrictionTerm("sign", FC),
            FrictionTerm("smooth_sign", FC, 0.003),
            FrictionTerm("stribeck_peak", FS, VS),
        ],
        [FrictionTerm("sign", FC), FrictionTerm("stribeck", FS, VS), FrictionTerm("hysteresis", FS, 0.01)],
    ],
    ids=["only fades in", "not there where the fall ends", "two falls", "two levels", "memory"],
)
def test_dry_friction_of_another_form_has_no_such_parameters(others: list[FrictionTerm]) -> None:
    assert FrictionLaw(((*others, FrictionTerm("viscous", FV)),)).stribeck_parameters(0) == {}


_LEVELS = [
    FrictionTerm("smooth_sign", 0.5, 0.003),
    FrictionTerm("smooth_sign", 0.2, 0.02),
    FrictionTerm("hysteresis", 0.1, 0.01),
]


@pytest.mark.parametrize(
    ("others", "static"),
    [
        ([], None),
        ([FrictionTerm("stribeck_peak", 0.3, 0.1)], 1.1),
        ([FrictionTerm("stribeck_peak", 0.3, 0.05)], None),
        ([FrictionTerm("stribeck_peak", 0.3, 0.1), FrictionTerm("stribeck_peak", 0.2, 0.4)], None),
        ([FrictionTerm("load_smooth_sign", 0.3, 0.003), FrictionTerm("offset", 0.4)], None),
    ],
    ids=["levels", "a fall", "a fall that ends while a level fades in", "two falls", "by load"],
)
def test_levels_add_up_once_the_joint_slides(others: list[FrictionTerm], static: float | None) -> None:
    law = FrictionLaw(((*_LEVELS, *others, FrictionTerm("viscous", FV)),))
    sums = {key: sum(t.coefficient for t in terms) for key, terms in law.sliding_sums(0).items()}
    expected = {"coulomb": 0.8, "viscous": FV, **({} if static is None else {"static": static})}
    assert sums == pytest.approx(expected)
    # what is there fast, far from any reversal, without the load
    unloaded = FrictionLaw((tuple(t for t in law.terms[0] if not t.by_load and t.kind != "offset"),))
    fast = unloaded.torque(at_speeds([5.0] * 3))[-1, 0]
    assert fast == pytest.approx(sums["coulomb"] + 5.0 * sums["viscous"], abs=1e-9)


@pytest.mark.parametrize("level", ["sign", "hysteresis"])
def test_the_viscous_friction_of_a_joint_is_the_mean_of_both_directions(level: str) -> None:
    """By Eq. (34) where the dry friction has that form, and once the joint slides where it has not."""
    either = FrictionTerm("viscous_forward", 0.6), FrictionTerm("viscous_backward", 0.2)
    law = FrictionLaw(((FrictionTerm(level, 0.5, 0.01), FrictionTerm("viscous", FV), *either),))
    sums = law.stribeck_sums(0) or law.sliding_sums(0)
    mean = sum(t.share * t.coefficient for t in sums["viscous"])
    ways = law.torque(at_speeds([2.0, 2.0, 2.0]))[-1, 0] - law.torque(at_speeds([-2.0, -2.0, -2.0]))[-1, 0]
    assert mean == pytest.approx(FV + 0.4) == pytest.approx((ways - 2 * 0.5) / (2 * 2.0))
    if level == "sign":
        assert law.stribeck_parameters(0)["viscous"] == mean


def test_the_direction_is_there_as_soon_as_its_fastest_part() -> None:
    sharp, memory = [FrictionTerm("sign", 0.1)], [FrictionTerm("hysteresis", 0.1, 0.01)]
    others = [FrictionTerm("stribeck_peak", 0.3, 0.001), FrictionTerm("viscous", FV)]
    laws = [[*_LEVELS, *others], [*_LEVELS, *sharp], memory, others]
    law = FrictionLaw(tuple(map(tuple, laws)))
    assert [law.fading(j) for j in range(4)] == [0.003, 0.0, 0.0, 0.0]


def test_beside_nonlinear_viscous_friction_no_level_is_stated() -> None:
    law = FrictionLaw(((*_LEVELS, FrictionTerm("root", 0.3)), ()))
    assert law.sliding_sums(0) == law.sliding_sums(1) == {}


@pytest.mark.parametrize("kind", ["stribeck", "stribeck_peak", "smooth_sign"])
def test_the_slope_by_the_parameter_is_the_derivative(kind: str) -> None:
    v = np.linspace(-1.0, 1.0, 41)
    exact = {
        "stribeck": -2 * v * np.abs(v) / 0.3**3 * np.exp(-((v / 0.3) ** 2)),
        "stribeck_peak": 2 * v * np.abs(v) / 0.3**3 * np.exp(-((v / 0.3) ** 2)),
        "smooth_sign": -v / 0.3**2 / np.cosh(v / 0.3) ** 2,
    }
    found = FrictionTerm(kind, 1.7, 0.3).slope(at_speeds(v), 0)
    np.testing.assert_allclose(found, 1.7 * exact[kind], atol=1e-8)


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        (FrictionTerm("offset"), [1, 1, 1]),
        (FrictionTerm("sign"), [-1, 0, 1]),
        (FrictionTerm("smooth_sign", parameter=0.5), np.tanh([-4, 0, 1])),
        (FrictionTerm("viscous"), [-2, 0, 0.5]),
        (FrictionTerm("root"), [-np.sqrt(2), 0, np.sqrt(0.5)]),
        (FrictionTerm("quadratic"), [-4, 0, 0.25]),
        (FrictionTerm("cubic"), [-8, 0, 0.125]),
        (FrictionTerm("stribeck", parameter=1.0), [np.exp(-4) - 1, 0, 1 - np.exp(-0.25)]),
        (FrictionTerm("stribeck_peak", parameter=2.0), [-np.exp(-1), 0, np.exp(-0.0625)]),
        (FrictionTerm("viscous_forward"), [0, 0, 0.5]),
        (FrictionTerm("viscous_backward"), [-2, 0, 0]),
        (FrictionTerm("both_ways"), [1, 0, 1]),
        # samples are a second apart
        (FrictionTerm("fading_sign", parameter=4.0), [-1, 0, np.exp(-0.5)]),
    ],
)
def test_columns(term, expected):
    np.testing.assert_allclose(term.column(at_speeds([-2.0, 0.0, 0.5]), 0), expected, atol=1e-12)


def test_friction_that_grows_with_load():
    motion = at_speeds([-2.0, 0.5])
    law = FrictionLaw(((FrictionTerm("load_sign", 0.1),),))
    np.testing.assert_allclose(law.torque(motion, load=np.array([[3.0], [-5.0]]))[:, 0], [-0.3, 0.5])
    with pytest.raises(ModelError, match="load_sign"):
        law.torque(motion)


def test_friction_with_memory_starts_afresh_with_each_run():
    q, v = [0, 0.1, 0.2, 0, 0.1, 0.2], np.array([0.001, 1, 1, 0.001, 1, 1])
    motion = at_speeds(v, q=q)
    apart = Motion(motion.time, motion.q, motion.v, motion.vdot, np.array([0, 3]))
    column = FrictionTerm("hysteresis", parameter=0.15).column(apart, 0)
    np.testing.assert_allclose(column, [0, 2 / 3, 1, 0, 2 / 3, 1])


def test_a_run_that_begins_in_mid_motion_begins_stretched():
    motion = at_speeds(np.ones(3), q=[0, 0.01, 0.02])
    term = FrictionTerm("hysteresis", parameter=0.15)
    np.testing.assert_allclose(term.column(motion, 0), 1.0)  # steady, so it has slid for long
    # speeding up at 2.5 rad/s^2 it has turned 0.2 rad since it was at rest: from -1 by 0.2/0.15
    speeding = Motion(motion.time, motion.q, motion.v, np.full((3, 1), 2.5), motion.starts)
    np.testing.assert_allclose(term.column(speeding, 0)[0], 0.2 / 0.15 - 1)


@pytest.mark.parametrize(
    ("v", "vdot", "state"),
    [
        (1.0, -2.5, 1.0),  # slowing down: it has slid for long
        (-1.0, 2.5, -1.0),
        (-1.0, -2.5, 1 - 0.2 / 0.15),
        (1.0, 0.0, 1.0),
        (1.0, 0.5, 1.0),  # a radian since it was at rest: slid
        (0.006, 0.5, -1 + 0.006**2 / 0.15),
        (0.0049, -1.0, 0.0),  # at rest: relaxed
        (0.005, -1.0, 0.0),
        (0.0, 1.0, 0.0),
    ],
)
def test_the_stretch_with_which_a_run_begins(v: float, vdot: float, state: float) -> None:
    assert _entry(np.array([v]), np.array([vdot]), 0.15)[0] == pytest.approx(state, abs=1e-12)


def test_by_load_without_a_direction_of_its_own() -> None:
    motion = at_speeds([-2.0, 0.5])
    fading = FrictionTerm("load_smooth_sign", parameter=0.5).column(motion, 0, np.array([[3.0], [-5.0]]))
    np.testing.assert_allclose(fading, [3 * np.tanh(-4.0), 5 * np.tanh(1.0)])
    assert FRICTION_LAWS["coulomb"] == FRICTION_LAWS["coulomb_fading"] == ("smooth_sign",)
    assert FRICTION_LAWS["nonlinear_viscous"] == ("root", "quadratic", "cubic")


def test_what_two_joints_share_acts_on_both() -> None:
    along, total = Direction(0, 2, -0.5), [1.0, 1.0, 1.0]
    assert along.of([4.0, 9.0, 2.0]) == 3.0 and Direction(1).of([4.0, 9.0, 2.0]) == 9.0
    along.add(total, 2.0)
    Direction(1).add(total, 5.0)
    assert total == [3.0, 6.0, 0.0]


def test_a_law_survives_its_dictionary_and_keeps_joints_apart():
    law = FrictionLaw(
        ((FrictionTerm("sign", 0.5),), (FrictionTerm("stribeck", -0.2, 0.1), FrictionTerm("viscous", 1.0)))
    )
    data = law.to_dict()
    assert [term["name"] for term in data[1]] == ["(1-exp(-(v2/0.1)^2))*sign(v2)", "v2"]
    assert FrictionLaw.from_dict(data) == law
    motion = Motion(np.zeros(1), np.zeros((1, 2)), np.array([[2.0, 0.0]]), np.zeros((1, 2)), np.array([0]))
    np.testing.assert_allclose(law.torque(motion), [[0.5, 0.0]])


@pytest.mark.parametrize(
    "data",
    [
        [[{"kind": "magic", "coefficient": 1.0}]],
        [[{"kind": "stribeck", "coefficient": 1.0}]],
        [[{"kind": "stribeck", "coefficient": 1.0, "parameter": -0.1}]],
        [[{"kind": "hysteresis", "coefficient": 1.0, "parameter": float("nan")}]],
    ],
)
def test_terms_that_are_none_are_refused(data):
    with pytest.raises(ModelError, match="friction"):
        FrictionLaw.from_dict(data)


#: Every kind at v = -0.7 and 0.7 rad/s with the parameter 0.5, 2 s after the start; the step that finds it, how its
#: direction turns, and whether it grows with the load.
FALL = np.exp(-1.96)
ROUNDED = 0.7 / (0.7**2 + 0.5**2) ** 0.25
AT = {
    "smooth_sign": (-1.0, 1.0, 1, "fading", False),
    "viscous": (-0.7, 0.7, 2, "sharp", False),
    "offset": (1.0, 1.0, 1, "sharp", False),
    "stribeck_peak": (-FALL, FALL, 2, "sharp", False),
    "root": (-ROUNDED, ROUNDED, 2, "sharp", False),
    "quadratic": (-0.49, 0.49, 2, "sharp", False),
    "cubic": (-0.343, 0.343, 2, "sharp", False),
    "viscous_forward": (0.0, 0.7, 2, "sharp", False),
    "viscous_backward": (-0.7, 0.0, 2, "sharp", False),
    "load_smooth_sign": (-1.0, 1.0, 1, "fading", True),
    "hysteresis": (-1.0, 1.0, 1, "memory", False),
    "load_hysteresis": (-1.0, 1.0, 1, "memory", True),
    "sign": (-1.0, 1.0, 1, "sharp", False),
    "load_sign": (-1.0, 1.0, 1, "sharp", True),
    "both_ways": (1.0, 1.0, 1, "sharp", False),
    "fading_sign": (-np.exp(-4.0), np.exp(-4.0), 1, "sharp", False),
    "stribeck": (FALL - 1.0, 1.0 - FALL, 2, "sharp", False),
}


@pytest.mark.parametrize("functions", [MATH, NUMPY])
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_at_a_state(kind, functions):
    element = KINDS[kind]
    back, forth = (element.value(Sliding(0.3, w * 0.7, w, 2.0), 0.5, functions) for w in (-1.0, 1.0))
    assert (back, forth) == (pytest.approx(AT[kind][0], rel=1e-9), pytest.approx(AT[kind][1], rel=1e-9))
    assert (element.step, element.way, element.by_load) == AT[kind][2:]
    assert element.part == "friction" and element.of_time == (kind == "fading_sign")


def test_a_root_is_rounded_off_where_it_has_no_slope():
    x = 1e-10
    root = KINDS["root"].value(Sliding(0.0, x, 1.0), 0.0, NUMPY)
    assert root == pytest.approx(x / (2 * x * x) ** 0.25)


def test_what_an_element_is_unless_it_is_said():
    element = Element(lambda x, p, f: x.v, "v{j}")
    assert (element.step, element.way, element.by_load, element.part) == (3, "sharp", False, "friction")
    assert FrictionTerm("viscous").acting == Acting(1.0, KINDS["viscous"], 0.0)
    assert FrictionTerm("smooth_sign", 2.0, 0.1).acting == Acting(2.0, KINDS["smooth_sign"], 0.1)
    assert Acting(3.0, element).parameter == 0.0


def test_what_is_steep_at_rest_is_widened_to_a_width_and_no_other_parameter_is():
    root = Acting(3.0, KINDS["root"]).widened(0.04)
    x = np.array([1e-6, 5.0])
    rounded = torque_along([root], Sliding(0.0, x, 1.0), 0.0, NUMPY)
    assert rounded == pytest.approx([3.0 * 1e-6 / np.sqrt(0.04), 3.0 * np.sqrt(5.0)], rel=1e-4)
    fading = Acting(2.0, KINDS["smooth_sign"], 0.05)
    assert [fading.widened(width).parameter for width in (0.0, 0.02, 0.5)] == [0.05, 0.05, 0.5]
    fall = Acting(1.0, KINDS["stribeck"], 0.01)
    assert fall.widened(0.5) == fall


def test_elements_add_up_with_what_fades_in_sharp_or_not():
    kinds = (("viscous", 2.0, 0.0), ("sign", 3.0, 0.0), ("load_sign", 4.0, 0.0), ("smooth_sign", 5.0, 0.5))
    terms = [Acting(c, KINDS[kind], p) for kind, c, p in kinds]
    x = Sliding(0.3, -0.7, -1.0)
    rest = 2.0 * -0.7 - 3.0 - 4.0 * 2.5
    assert torque_along(terms, x, -2.5, MATH) == pytest.approx(rest - 5.0)
    assert torque_along(terms, x, -2.5, MATH, False) == pytest.approx(rest + 5.0 * np.tanh(-1.4))
    assert torque_along([], x, 1.0, MATH) == 0.0
