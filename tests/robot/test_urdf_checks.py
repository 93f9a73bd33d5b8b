"""A URDF that Drake reads becomes an arm, grippers and branches on request; one that cannot be is refused in one line."""

import os
import re
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from armloop.cli import main
from armloop.drake.experiments.scenarios import plant_for
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.errors import ArmError, InputWarning

LINK = """<link name="{0}"><inertial><origin xyz="0.1 0 0.02"/><mass value="{1}"/>
<inertia ixx="{2}" iyy="{3}" izz="{4}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


def link(name: str, mass: object = 2.0, ixx: object = 0.03, iyy: object = 0.04, izz: object = 0.05) -> str:
    return LINK.format(name, mass, ixx, iyy, izz)


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", more: str = "", limit: str | None = None
) -> str:
    limit = 'lower="-2" upper="2" velocity="3" effort="50"' if limit is None else limit
    return f"""<joint name="{name}" type="{kind}"><origin xyz="0.3 0 0.1" rpy="0.2 0.1 -0.3"/>
<parent link="{parent}"/><child link="{child}"/><axis xyz="0 1 0"/><limit {limit}/>{more}</joint>"""


PARTS = [
    link("base"), joint("j1", "base", "l1"), link("l1"), joint("j2", "l1", "l2", "continuous"), link("l2"),
    joint("finger_a", "l2", "fa", "prismatic"), link("fa", 0.1),
    joint("finger_b", "l2", "fb", "prismatic", '<mimic joint="finger_a"/>'), link("fb", 0.1),
]  # fmt: skip


def write(path: Path, *parts: str) -> Path:
    path.write_text(f"<robot name='arm'>{''.join(parts)}</robot>")
    return path


GOOD = "".join(PARTS[:5])

WRONG: dict[str, tuple[str, str]] = {
    "a mass of a mountain": (GOOD.replace('value="2.0"', 'value="1e9"', 1), r"<mass> value=1e\+09 must be from 0 to 1e\+06"),
    "a body out of this world": (GOOD.replace('xyz="0.1 0 0.02"', 'xyz="1e12 0 0"', 1), r"is 1e\+12 m away, as no part"),
    "a mass with a unit": (GOOD.replace('value="2.0"', 'value="1kg"', 1), r"link 'base': <mass> value='1kg'"),
    "a decimal comma": (GOOD.replace('value="2.0"', 'value="1,5"'), r"link 'base': <mass> value='1,5'"),
    "a negative mass": (GOOD.replace('value="2.0"', 'value="-1"'), r"link 'base': <mass> value=-1 must be from 0"),
    "NaN mass": (GOOD.replace('value="2.0"', 'value="nan"'), r"<mass> value='nan' is not a finite number"),
    "no mass": (GOOD.replace('<mass value="2.0"/>', ""), r"link 'base': <inertial> has no <mass>"),
    "no inertia": ("".join(PARTS[:4]) + link("l2").split("<inertia ")[0] + "</inertial></link>", r"'l2': .* no <inertia>"),
    "part of an inertia": (GOOD.replace('ixx="0.03" ', ""), r"link 'base': <inertia> has no ixx"),
    "text for an inertia": (GOOD.replace('ixx="0.03"', 'ixx="big"'), r"<inertia> ixx='big' is not a finite"),
    "a negative inertia": (GOOD.replace('ixx="0.03"', 'ixx="-0.03"'), r"not positive definite: .*-0.03"),
    "an indefinite inertia": (GOOD.replace('ixy="0"', 'ixy="0.2"'), r"<inertia> is not positive definite"),
    "lower above upper": (GOOD.replace('lower="-2" upper="2"', 'lower="2" upper="-2"'), r"lower=2 is above upper=-2; ex"),
    "lower equal to upper": (GOOD.replace('lower="-2" upper="2"', 'lower="1" upper="1"'), r"--lock j1=1"),
    "a negative velocity": (GOOD.replace('velocity="3"', 'velocity="-3"'), r"<limit> velocity=-3 must be positive"),
    "a negative effort": (GOOD.replace('effort="50"', 'effort="-5"'), r"<limit> effort=-5"),
    "NaN limit": (GOOD.replace('upper="2"', 'upper="nan"'), r"<limit> upper='nan' is not a finite number"),
    "text for a limit": (GOOD.replace('upper="2"', 'upper="2rad"'), r"<limit> upper='2rad'"),
    "an axis of two": (GOOD.replace('xyz="0 1 0"', 'xyz="0 1"'), r"joint 'j1': <axis> xyz='0 1' must be three"),
    "an axis of four": (GOOD.replace('xyz="0 1 0"', 'xyz="0 1 0 0"'), r"<axis> xyz='0 1 0 0' must be three"),
    "an axis without length": (GOOD.replace('xyz="0 1 0"', 'xyz="0 0 0"'), r"joint 'j1': <axis> has no length"),
    "an origin of two": (GOOD.replace('xyz="0.3 0 0.1"', 'xyz="0.3 0"'), r"joint 'j1': <origin> xyz='0.3 0' must"),
    "an origin of text": (GOOD.replace('rpy="0.2 0.1 -0.3"', 'rpy="a b c"'), r"joint 'j1': <origin> rpy='a b c'"),
    "a NaN origin": (GOOD.replace('xyz="0.1 0 0.02"', 'xyz="nan 0 0"'), r"link 'base': <origin> xyz='nan 0 0'"),
    "a parent that is not there": (GOOD.replace('parent link="l1"', 'parent link="l9"'), r"parent link 'l9' is not decl"),
    "a child that is not there": (GOOD.replace('child link="l2"', 'child link="l9"'), r"child link 'l9' is not declared"),
    "no child": (GOOD.replace('<child link="l2"/>', ""), r"joint 'j2': has no <child|joint 'j2' has no <child"),
    "a name of 300 characters": (GOOD.replace("l1", "x" * 300), r"a name of 300 characters"),
    "two links of one name": (GOOD + link("l2"), r"link 'l2' is declared twice"),
    "an unknown type": (GOOD.replace('"continuous"', '"rotary"'), r"joint 'j2': type 'rotary'; it must be one of rev"),
    "a ball": (GOOD.replace('"continuous"', '"ball"'), r"joint 'j2': type 'ball'; it must be one of"),
    "a joint that floats": (GOOD.replace('"continuous"', '"floating"'), r"joint 'j2': type 'floating'; it must be one of"),
    "an Arabic digit": (GOOD.replace('value="2.0"', 'value="٢"'), r"<mass> value='٢' is not a finite number"),
    "two masses": (GOOD.replace('<mass value="2.0"/>', '<mass value="2"/><mass value="3"/>', 1), r"2 elements <mass>"),
    "two inertials": (GOOD.replace("<inertial>", "<inertial/><inertial>", 1), r"link 'base': 2 elements <inertial>"),
    "two limits": (GOOD.replace("<limit", '<limit lower="0" upper="1"/><limit', 1), r"joint 'j1': 2 elements <limit>"),
    "two axes": (GOOD.replace("<axis", '<axis xyz="1 0 0"/><axis', 1), r"joint 'j1': 2 elements <axis>"),
    "negative damping": (GOOD.replace("<limit", '<dynamics damping="-1"/><limit', 1), r"joint 'j1': <dynamics> damping=-1"),
    "friction in words": (GOOD.replace("<limit", '<dynamics friction="low"/><limit', 1), r"<dynamics> friction='low'"),
    "a line feed in a name": (GOOD.replace('name="j1"', 'name="a&#10;b"'), r"joint 'a\\nb': a name of characters"),
    "a name that turns the line": (GOOD.replace('name="j1"', 'name="a\u202eb"'), r"joint 'a\\u202eb': a name of"),
    "two parents": (GOOD + joint("back", "base", "l2"), r"link 'l2' is the child of two joints, 'j2' and 'back'"),
    "a joint on itself": (GOOD.replace('child link="l1"', 'child link="base"'), r"joint 'j1' joins link 'base' to itself"),
    "two bases": (GOOD + link("alone"), r"bad\.urdf: a serial arm has exactly one base link, this URDF has 2: base, alone"),
    "xacro": (GOOD + '<xacro:macro name="a"/>', r"holds xacro .*xacro in.xacro > out.urdf"),
    "a xacro expression": (GOOD.replace('value="2.0"', 'value="${m}"'), r"holds xacro"),
    "forty joints": (
        link("l0") + "".join(link(f"l{k + 1}") + joint(f"j{k}", f"l{k}", f"l{k + 1}") for k in range(40)),
        r"40 moving joints, at most 16 .*--lock",
    ),
    "fingers": ("".join([*PARTS[:7], joint("f2", "l2", "fb", "prismatic"), PARTS[8]]), r"2 moving joints follow .*--tip"),
    "a mimic": ("".join(PARTS), r"joint 'finger_b' mimics 'finger_a'.*--lock finger_b=0"),
    "a loop": (GOOD + joint("back", "l2", "base", "fixed"), r"joints 'j2', 'back', 'j1' form a loop"),
    "a loop beside the base": (GOOD.replace('parent link="base"', 'parent link="l2"'), r"joints 'j2', 'j1' form a loop"),
    "what hangs on a loop": (
        GOOD.replace('parent link="base"', 'parent link="l2"').replace("<joint", joint("first", "l1", "tool") + "<joint", 1)
        + link("tool"),
        r"joints 'j2', 'j1' form a loop",
    ),
    "a mimic of none": ("".join(PARTS).replace('joint="finger_a"', 'joint="x"'), r"mimics 'x', which no joint is called"),
}  # fmt: skip


@pytest.mark.parametrize("fault", WRONG)
def test_what_cannot_be_is_refused_with_the_element(tmp_path: Path, fault: str) -> None:
    body, expected = WRONG[fault]
    path = write(tmp_path / "bad.urdf", body)
    with pytest.raises(ArmError, match=expected) as caught:
        load_arm(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message and len(message) < 400


def test_infinite_limits_are_none(tmp_path: Path) -> None:
    body = GOOD.replace('lower="-2" upper="2"', 'lower="-inf" upper="INF"').replace(
        'effort="50"', 'effort="Infinity"'
    )
    (joint, *_) = load_arm(write(tmp_path / "arm.urdf", body)).joints
    assert (joint.lower, joint.upper, joint.effort, joint.velocity) == (-np.inf, np.inf, np.inf, 3.0)
    with pytest.raises(ArmError, match="lower=inf is above upper=2"):
        load_arm(write(tmp_path / "bad.urdf", GOOD.replace('lower="-2"', 'lower="inf"')))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "iso-8859-1", "utf-8-sig", "utf-8"])
def test_a_urdf_may_be_in_an_encoding_that_it_declares(tmp_path: Path, encoding: str) -> None:
    """Blank lines before its declaration do no harm; the arm's own text is in UTF-8, and can be read again."""
    plain = write(tmp_path / "plain.urdf", GOOD.replace('"j1"', '"gelänk"')).read_text(encoding="utf-8")
    body = plain[plain.index("<robot") :]
    declared = {"utf-8-sig": "utf-8", "utf-16-le": "utf-16"}.get(encoding, encoding)
    path = tmp_path / "arm.urdf"
    mark = "\ufeff" if encoding == "utf-16-le" else ""
    path.write_bytes(f'{mark}\n<?xml version="1.0" encoding="{declared}"?>\n{body}'.encode(encoding))
    arm = load_arm(path)
    assert arm.joints[0].name == "gelänk"
    ElementTree.fromstring(arm.urdf.encode("utf-8"))  # what it declares now is true
    path.write_text(arm.urdf, encoding="utf-8")
    assert load_arm(path).joints == arm.joints


def test_a_robot_has_a_name(tmp_path: Path) -> None:
    path = write(tmp_path / "arm.urdf", GOOD)
    path.write_text(re.sub("<robot [^>]*>", "<robot>", path.read_text()))
    with pytest.raises(ArmError, match=r"<robot> has no name; give it one"):
        load_arm(path)


def test_entities_are_not_expanded_and_bytes_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "bad.urdf"
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'
    path.write_text(bomb)
    with pytest.raises(ArmError, match="entities, which are not expanded"):
        load_arm(path)
    path.write_bytes(b"<robot name='\xff\xfe'/>")
    with pytest.raises(ArmError, match="not a text in UTF-8"):
        load_arm(path)
    for encoding in ("klingon", "undefined", "hex"):
        path.write_bytes(
            f"<?xml version='1.0' encoding='{encoding}'?>".encode() + b"<robot name='\xff\xfe'/>"
        )
        with pytest.raises(ArmError, match="nor in an encoding that it declares"):
            load_arm(path)
    with pytest.raises(ArmError, match="cannot be read"):
        load_arm("a" * 300 + ".urdf")
    with pytest.raises(ArmError, match=r"cannot be read|no such file"):
        load_arm("a\0b.urdf")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may enter every folder")
def test_a_folder_without_permission_is_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "closed"
    folder.mkdir()
    path = write(folder / "arm.urdf", GOOD)
    folder.chmod(0)
    try:
        with pytest.raises(ArmError, match="cannot be read"):
            load_arm(path)
    finally:
        folder.chmod(0o700)


def test_doubtful_inertias_are_said_and_load(tmp_path: Path) -> None:
    with pytest.warns(InputWarning, match=r"link 'l1': <inertia> is zero with a mass of 2 kg"):
        arm = load_arm(write(tmp_path / "a.urdf", link("base"), PARTS[1], link("l1", 2.0, 0, 0, 0)))
    assert arm.n == 1
    with pytest.warns(InputWarning, match=r"principal moments 0.03, 0.04, 0.5 .*two add up"):
        load_arm(write(tmp_path / "a.urdf", link("base"), PARTS[1], link("l1", izz=0.5)))
    dummy = '<link name="base"/>' + PARTS[1] + '<link name="l1"/>'
    assert load_arm(write(tmp_path / "a.urdf", dummy)).mass[0] == 0.0


DOUBTFUL = {
    "millimetres": (GOOD.replace('xyz="0.3 0 0.1"', 'xyz="300 0 100"', 1), r"xyz='300 0 100' is 316 m away"),
    "a centre in millimetres": (GOOD.replace('xyz="0.1 0 0.02"', 'xyz="100 0 20"', 1), r"'base': .* 102 m"),
    "degrees": (GOOD.replace('rpy="0.2 0.1 -0.3"', 'rpy="90 0 0"', 1), r"joint 'j1': <origin> rpy='90 0 0' turns by more"),
    "limits in degrees": (GOOD.replace('lower="-2" upper="2"', 'lower="-170" upper="170"', 1), r"are they degrees"),
    "g cm²": (GOOD.replace('ixx="0.03" iyy="0.04" izz="0.05"', 'ixx="30000" iyy="40000" izz="50000"', 1), r"reaches 158 m"),
}  # fmt: skip


@pytest.mark.parametrize("doubt", DOUBTFUL)
def test_what_looks_like_another_unit_is_said(tmp_path: Path, doubt: str) -> None:
    body, expected = DOUBTFUL[doubt]
    with pytest.warns(InputWarning, match=expected):
        load_arm(write(tmp_path / "a.urdf", body))


#: As exporters and authors of published URDFs leave them: what is said, and the limits of the first joint.
AS_PUBLISHED = {
    "xacro in a comment": (GOOD + '<!-- <xacro:arm side="${side}"/> -->', None, (-2, 2, 3)),
    "a prefix that is not declared": (
        GOOD.replace('velocity="3"', 'velocity="3" drake:acceleration="2"') + '<drake:group name="g"/>', None, (-2, 2, 3)
    ),
    "no speed": (GOOD.replace('velocity="3"', 'velocity="0"'), r"j1.*velocity=0 is taken for unknown", (-2, 2, np.inf)),
    "limits of nothing": (
        GOOD.replace('lower="-2" upper="2" velocity="3" effort="50"', 'lower="0" upper="0" velocity="0" effort="0"'),
        r"j1.*<limit> is zero throughout", (-np.inf, np.inf, np.inf)
    ),
    "a limit of none": (GOOD.replace('lower="-2"', 'lower="-1e16"'), r"lower=-1e\+16 is taken for none", (-np.inf, 2, 3)),
    "a rounding for an inertia": (
        GOOD.replace('ixx="0.03" iyy="0.04" izz="0.05" ixy="0"', 'ixx="0" iyy="0" izz="0" ixy="2e-35"', 1),
        r"'base': <inertia> is zero with a mass", (-2, 2, 3)
    ),
    "a base that no body is": (GOOD.replace('ixy="0"', 'ixy="0.2"', 1), r"'base': .*but this link never moves", (-2, 2, 3)),
    "a base of a mass alone": (
        link("base").split("<inertia ")[0] + "</inertial></link>" + "".join(PARTS[1:5]),
        r"'base': <inertial> has no <inertia>, but this link never moves", (-2, 2, 3)
    ),
    "a fixed joint that mimics": (
        GOOD + joint("f", "l2", "f", "fixed", '<mimic joint="j1"/>') + link("f", 0.1), None, (-2, 2, 3)
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", AS_PUBLISHED)
def test_urdfs_are_read_as_they_are_published(tmp_path: Path, case: str) -> None:
    body, said, limits = AS_PUBLISHED[case]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        arm = load_arm(write(tmp_path / "a.urdf", body))
    first = arm.joints[0]
    assert (arm.n, (first.lower, first.upper, first.velocity)) == (2, limits)
    lines = [str(each.message) for each in caught]
    assert any(re.search(said, line) for line in lines) if said else not lines


def test_names_with_a_prefix_stay_as_they_are_where_a_joint_is_locked(tmp_path: Path) -> None:
    body = GOOD.replace('velocity="3"', 'velocity="3" drake:acceleration="2"', 1)
    arm = load_arm(write(tmp_path / "a.urdf", body), lock={"j2": 0.1})
    assert arm.n == 1 and 'drake:acceleration="2"' in arm.urdf
    assert plant_for(arm).arm.n == 1  # what reads the arm's own text again


def test_large_things_that_are_usual_are_not_said(tmp_path: Path) -> None:
    """Limits of a thousand turns stand for none; a gantry has ten metres."""
    body = GOOD.replace('lower="-2" upper="2"', 'lower="-1e4" upper="1e4"', 1).replace(
        'xyz="0.3 0 0.1"', 'xyz="9 0 0"', 1
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_arm(write(tmp_path / "a.urdf", body)).n == 2


def test_a_lock_beyond_the_limits_is_said(tmp_path: Path) -> None:
    path = write(tmp_path / "a.urdf", GOOD)
    with pytest.warns(InputWarning, match=r"--lock j1=50 is outside of the joint's limits, -2 to 2"):
        load_arm(path, {"j1": 50.0})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_arm(path, {"j1": -2.0})
        load_arm(path, {"j2": 50.0})  # it turns without end


def test_a_base_welded_to_an_undeclared_world_is_read(tmp_path: Path) -> None:
    weld = '<joint name="w" type="fixed"><origin xyz="0 0 0.5"/><parent link="world"/><child link="base"/></joint>'
    plain = load_arm(write(tmp_path / "plain.urdf", GOOD))
    welded = load_arm(write(tmp_path / "welded.urdf", GOOD, weld))
    assert welded.n == plain.n == 2
    np.testing.assert_allclose(welded.X_PF[0, :3, 3], plain.X_PF[0, :3, 3] + [0, 0, 0.5])


@pytest.mark.measured
def test_the_double_pendulum_as_published_is_read(measured: Path) -> None:
    arm = load_arm(measured / "double_pendulum" / "double_pendulum.urdf")
    assert [joint.name for joint in arm.joints] == ["Joint1", "Joint2"]
    np.testing.assert_allclose(arm.mass, [0.5234602, 0.6255677], rtol=1e-6)


def torque(arm, q: list[float], rest: list[float]) -> np.ndarray:
    """Torque at rest with an acceleration of all joints."""
    q, rest = np.atleast_2d(q), np.atleast_2d(rest)
    return (regressor(arm, q, 0 * q, rest) @ nominal_parameters(arm))[0]


def test_a_locked_joint_is_the_same_arm_held_there(tmp_path: Path) -> None:
    three = write(tmp_path / "three.urdf", *PARTS[:5], joint("j3", "l2", "l3"), link("l3", 1.3))
    whole = load_arm(three)
    for name, kept, q in (("j3", [0, 1], [0.3, -0.4, 0.7]), ("j2", [0, 2], [0.3, 1.9, 0.2])):
        locked = load_arm(three, lock={name: q[({0, 1, 2} - set(kept)).pop()]})
        assert [joint.name for joint in locked.joints] == [whole.joints[k].name for k in kept]
        accelerations = np.array([0.5, 0.5, 0.5])
        accelerations[({0, 1, 2} - set(kept)).pop()] = 0.0
        np.testing.assert_allclose(
            torque(locked, [q[k] for k in kept], accelerations[kept].tolist()),
            torque(whole, q, accelerations.tolist())[kept],
            rtol=1e-9,
        )
    slider = write(tmp_path / "slider.urdf", *PARTS[:5], joint("s", "l2", "l3", "prismatic"), link("l3", 1.3))
    np.testing.assert_allclose(
        torque(load_arm(slider, lock={"s": 0.2}), [0.3, -0.4], [1.0, 2.0]),
        torque(load_arm(slider), [0.3, -0.4, 0.2], [1.0, 2.0, 0.0])[:2],
        rtol=1e-9,
    )


def test_the_tip_leaves_out_fingers_and_keeps_their_mass(tmp_path: Path) -> None:
    path = write(tmp_path / "gripper.urdf", *PARTS)
    arm = load_arm(path, tip="l2")
    locked = load_arm(path, lock={"finger_a": 0.0, "finger_b": 0.0})
    for one in (arm, locked):
        assert [joint.name for joint in one.joints] == ["j1", "j2"]
        assert one.mass[1] == pytest.approx(2.2)
    np.testing.assert_allclose(arm.inertia, locked.inertia)
    assert [element.get("type") for element in ElementTree.fromstring(arm.urdf).iter("joint")].count(
        "fixed"
    ) == 2


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--lock", "finger_a"], "--lock finger_a: give JOINT=VALUE"),
        (["--lock", "finger_a=wide"], "--lock finger_a=wide: give JOINT=VALUE"),
        (["--lock", "nobody=0"], "--lock nobody: no moving joint of this name; there are: j1, j2, finger_a"),
        (["--lock", "finger_a=nan", "--tip", "l2"], "give a finite position"),
        (["--tip", "hand"], "--tip hand: no link of this name; there are: base, l1, l2"),
    ],
)
def test_options_that_name_nothing_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], expected: str
) -> None:
    path = write(tmp_path / "gripper.urdf", *PARTS)
    assert main(["excite", str(path), "--out", str(tmp_path / "ref.csv"), *options]) == 2
    error = capsys.readouterr().err
    assert expected in error and error.count("\n") == 1


def test_links_without_mass_and_joints_of_no_arm_raise_no_voice_of_drake(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    massless = re.sub(r'<mass value="[^"]*"', '<mass value="0"', GOOD)
    with pytest.warns(InputWarning, match="<mass> is zero with an <inertia>"):
        arm = load_arm(write(tmp_path / "a.urdf", massless))
    assert not arm.mass.any() and not arm.inertia.any()
    with pytest.raises(ArmError, match="it must be one of revolute"):
        load_arm(write(tmp_path / "a.urdf", GOOD.replace('"continuous"', '"floating"')))
    assert not caplog.records


@pytest.mark.parametrize("izz", [0.07 + 1e-7, 0.0702, 0.5])
def test_an_inertia_that_misses_the_triangle_inequality_is_taken_to_the_nearest_of_a_body(
    tmp_path: Path, izz: float
) -> None:
    arms = []
    for each in (0.07, izz):  # 0.03 and 0.04 are the other two principal moments
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)
            arms.append(load_arm(write(tmp_path / "a.urdf", link("base"), PARTS[1], link("l1", izz=each))))
    np.testing.assert_allclose(arms[1].inertia, arms[0].inertia, atol=1e-9)
    np.testing.assert_array_equal(arms[1].mass, arms[0].mass)
