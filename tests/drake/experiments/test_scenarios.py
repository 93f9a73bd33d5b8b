"""Scenario files: the built-in ones load, and what is wrong with one is said in one line."""

import runpy

import numpy as np
import pytest
from numpy.testing import assert_allclose

from armloop.drake.control.controllers import LISTED
from armloop.drake.experiments import scenarios
from armloop.drake.experiments.scenarios import (
    load_plan,
    load_plant,
    load_tracking,
    plant_for,
    plant_names,
)
from armloop.drake.plant.config import Instruments, PlantConfig
from armloop.experiment.excitation import fourier_reference, write_reference
from armloop.robot.arm import load_arm
from armloop.schemas.scenarios import FrictionData, PlantData, RangesData
from armloop.util.errors import ScenarioError
from armloop.util.resources import scenario_path, urdf_path

OWN = """
own_plant:
  arm: three_axis
  friction:
    - {static: 1.0, coulomb: 0.8, stribeck_velocity: 0.1, viscous: 1.0}
    - {static: 1.0, coulomb: 0.8, stribeck_velocity: 0.1, viscous: 1.0}
    - {coulomb: 0.5, static: 0.5}
"""


def load(tmp_path, text):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return load_tracking(path)


def test_built_in_plants():
    assert plant_names() == ["scara", "three_axis"]
    three = load_plant("three_axis")
    assert [f.coulomb for f in three.config.friction] == [0.557, 0.757, 0.585]
    assert_allclose([f.static / f.coulomb for f in three.config.friction], 1.3, rtol=1e-4)
    # Table 3
    assert_allclose(three.config.ranges.upper, [np.pi / 2, np.pi / 3, np.pi])
    assert_allclose(three.config.ranges.velocity, np.pi / 2)
    assert_allclose(three.config.ranges.acceleration, np.pi)
    # Table 1
    ranges = load_plant("scara").config.ranges
    assert_allclose(ranges.lower, [-np.pi / 2, -np.pi / 2, 0, -np.pi / 2], atol=1e-7)
    assert_allclose(ranges.acceleration, [np.pi / 2, np.pi / 2, 0.2, np.pi / 2])


@pytest.mark.parametrize("name", ["paper", "dwell", "quick"])
def test_built_in_plans(name):
    plan = load_plan(name)
    assert plan.dwell == (name == "dwell")
    assert plan.static_speed == pytest.approx(np.deg2rad(0.1))


def test_built_in_tracking():
    scenario = load_tracking("three_axis_tracking")
    assert_allclose(np.stack([scenario.gains.kp, scenario.gains.ki, scenario.gains.kd])[:, 0], [80, 8, 2])
    assert scenario.score == (20.0, 40.0)
    assert scenario.controllers == ("pid", "pid_step1", "pid_step3")
    assert scenario.plant.name == "three_axis"


@pytest.mark.parametrize(("duration", "score"), [(40.0, (20.0, 40.0)), (8.0, (4.0, 8.0))])
def test_the_second_half_of_a_run_is_scored_where_no_interval_is_stated(tmp_path, duration, score):
    scenario = load(tmp_path, f"plant: three_axis\nreference: {{kind: fourier, duration: {duration}}}\n")
    assert scenario.score == score


def test_own_plant_and_urdf_beside_the_scenario(tmp_path):
    scenario = load(tmp_path, OWN + "kd: [2.0, 3.0, 2.5]\nscore: [0.0, 20.0]\n")
    assert scenario.plant.config.friction[0].static == 1.0
    assert_allclose(scenario.gains.kd, [2.0, 3.0, 2.5])
    (tmp_path / "beside.urdf").write_text(scenario.plant.arm.urdf)
    assert load(tmp_path, OWN.replace("arm: three_axis", "arm: beside.urdf")).plant.arm.n == 3
    scara = OWN.replace("three_axis", "scara").rstrip() + "\n    - {coulomb: 0.1, static: 0.1}\n"
    assert load(tmp_path, scara + "reference: {kind: fourier, duration: 40.0}\n").reference.duration == 40.0


TWO = """
slow:
  plant: three_axis
  reference: {kind: places, dwell: 0.5, places: [[0.0, 0.0, 0.0], [0.3, -0.2, 0.1]], pace: 0.5}
  score: []
mine:
  plant: three_axis
  score: [0.0, 20.0]
"""


def test_a_file_may_hold_several_scenarios(tmp_path):
    assert load(tmp_path, TWO).score == (0.0, 20.0)  # the one named as the file
    path = tmp_path / "mine.yaml"
    slow = load_tracking(f"{path}:slow")
    assert slow.name == "mine:slow" and slow.score == (0.0, slow.reference.duration)
    (tmp_path / "other.yaml").write_text(TWO)
    assert load_tracking(tmp_path / "other.yaml").name == "other:slow"  # else the first
    with pytest.raises(ScenarioError, match=r"mine.yaml: there is no scenario 'fast'; there are: slow, mine"):
        load_tracking(f"{path}:fast")
    with pytest.raises(ScenarioError, match=r"mine.yaml: slow: field 'Kp' is unknown"):
        load_tracking(f"{_written(path, TWO.replace('  score: []', '  Kp: []'))}:slow")
    with pytest.raises(ScenarioError, match=r"holds one scenario without a name; leave out :slow"):
        load_tracking(f"{_written(path, 'plant: three_axis')}:slow")
    # nothing below one of the names is told of that name, and hides no other
    assert load_tracking(f"{_written(path, TWO + 'later:')}:slow").name == "mine:slow"
    with pytest.raises(ScenarioError, match=r"mine.yaml: later is None; it must be a mapping of fields"):
        load_tracking(f"{path}:later")
    # one with a field that is misspelt is no file of several
    with pytest.raises(ScenarioError, match=r"mine.yaml: field 'limts' is unknown"):
        load_tracking(_written(path, "plant: three_axis\nlimts: {effort: [9.0]}"))
    assert set(load_tracking("three_axis_tracking:all_controllers").controllers) <= {*LISTED} - {"bounded"}


def _written(path, text):
    path.write_text(text)
    return path


def test_places_keep_the_ranges_speeds_and_rest(tmp_path):
    load(tmp_path, TWO)
    scenario = load_tracking(f"{tmp_path / 'mine.yaml'}:slow")
    ranges = scenario.plant.config.ranges
    t = np.linspace(0, scenario.reference.duration, 4001)
    q, v, vdot = scenario.reference.evaluate(t)
    assert_allclose(q[[0, -1]], [[0, 0, 0], [0.3, -0.2, 0.1]])
    assert_allclose(v[(t < 0.5) | (t > t[-1] - 0.5)], 0.0, atol=1e-12)
    used = [
        np.abs(v).max() / (0.5 * ranges.velocity[0]),
        np.abs(vdot).max() / (0.25 * ranges.acceleration[0]),
    ]
    assert max(used) == pytest.approx(1.0, rel=1e-3)


def test_the_arm_may_be_left_to_the_user(tmp_path):
    text = OWN.replace("  arm: three_axis\n", "") + "score: [0.0, 20.0]\n"
    with pytest.raises(ScenarioError, match=r"own_plant: arm is missing; give .* or by --arm"):
        load(tmp_path, text)
    assert load_tracking(tmp_path / "mine.yaml", "three_axis").plant.arm.name == "three_axis"
    with pytest.raises(ScenarioError, match="friction has 3 joints; scara has 4"):
        load_tracking(tmp_path / "mine.yaml", "scara")
    with pytest.raises(ScenarioError, match="--arm is for scenarios with own_plant"):
        load_tracking("three_axis_tracking", "scara")
    with pytest.raises(ScenarioError, match="ur10e_tracking: own_plant: arm is missing"):
        load_tracking("ur10e_tracking")


def test_a_reference_from_a_file(tmp_path):
    made = fourier_reference(load_plant("scara").config.ranges, 6.0, seed=4)
    write_reference(tmp_path / "mine.csv", made, 200.0)
    scara = "plant: scara\nscore: [1.0, 6.0]\nreference: {kind: csv, file: mine.csv}\n"
    scenario = load(tmp_path, scara)
    assert scenario.reference.duration == 6.0
    t = np.linspace(0, 6, 777)
    for ours, theirs in zip(scenario.reference.evaluate(t), made.evaluate(t), strict=True):
        assert_allclose(ours, theirs, atol=1e-6)
    with pytest.raises(ScenarioError, match=r"reference.file: .*mine.csv: column q4 is of a joint"):
        load(tmp_path, scara.replace("plant: scara", "plant: three_axis"))
    with pytest.raises(ScenarioError, match=r"reference\.file is missing"):
        load(tmp_path, "plant: scara\nreference: {kind: csv}\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("plant: nowhere\n", "plant: 'nowhere' is unknown; there are: scara, three_axis"),
        ("kp: [80]\n", "plant: give either"),
        (OWN + "plant: three_axis\n", "plant: give either"),
        ("plant: three_axis\nKp: [80]\n", "field 'Kp' is unknown"),
        ("plant: three_axis\nkp: 80\n", "kp is 80; it must be a list"),
        ("plant: three_axis\nkp: [high]\n", r"kp\[1\] is 'high'; it must be a finite number"),
        (
            "plant: three_axis\nkp: [80, 80]\n",
            "kp has 2 numbers; it must have one number or one per joint, 3",
        ),
        ("plant: three_axis\nki: [-1]\n", "must not be negative"),
        ("plant: three_axis\nki: [8, -1, 8]\n", "must not be negative"),
        ("plant: three_axis\nki: [.nan]\n", "must be a finite number"),
        ("plant: three_axis\nscore: [30, 50]\n", "score is .* in 0 to 40 s"),
        ("plant: three_axis\ncontrollers: [lqr]\n", "controllers: lqr; there are: pid"),
        ("plant: three_axis\nreference: {kind: circle}\n", "reference.kind is 'circle'"),
        ("plant: three_axis\nbandwidth: 0\n", "bandwidth is 0; it must be a finite number above 0"),
        (
            "plant: three_axis\nreference: {kind: places}\n",
            "reference.places must be two or more places of 3",
        ),
        (
            "plant: three_axis\nreference: {kind: places, places: [[0, 0, 0], [0, 0, 0]]}\n",
            "reference.places: place 2 is the same",
        ),
        ("plant: three_axis\nreference: {unit: 1.0}\n", "joint 1 would go from"),
        ("plant: three_axis\nreference: {periods: 0}\n", "reference.periods is 0"),
        ("plant: scara\n", "reference: the paper's is for 3 joints; scara has 4: give kind: fourier"),
        ("plant: three_axis\nrandom_seed: soon\n", "random_seed is 'soon'; it must be a whole number"),
        (OWN.replace("three_axis", "nowhere"), "own_plant: arm: .*no such file"),
        (OWN.replace("arm: three_axis", "arm: scara"), "friction has 3 joints; scara has 4"),
        (
            OWN.replace("coulomb: 0.8", "coulomb: 8.0"),
            "friction of joint 1: static 1.0 must be at least coulomb",
        ),
        (OWN.replace("viscous", "viscosity"), r"friction\[1\]: field 'viscosity' is unknown"),
        (OWN + "  time_step: 0.5\n", "time_step is 0.5; it must be"),
        (
            OWN + "  rotor_inertia: [0.1, 0.2]\n",
            "own_plant: rotor_inertia has 2 numbers; it must have one per",
        ),
        (OWN + "  rotor_inertia: [0.1, 0.2, -1]\n", r"own_plant.rotor_inertia\[3\] is -1"),
        (OWN + "  encoder_counts: -1\n", "encoder_counts is -1"),
        (
            OWN + "  ranges: {lower: [0], upper: [1], velocity: [1], acceleration: [1]}\n",
            "ranges.lower has 1 numbers",
        ),
        ("[1, 2]\n", "must be a mapping"),
        ("plant: [\n", "unreadable YAML"),
        (
            OWN + "effects: [{effect: transmission_coupling, joint: 2, other_joint: 2, parameters: "
            "{inertia: 0.0, viscous: 0.1, coulomb: 0.1, ratio: 1.0}}]\n",
            "effects: effect 'transmission_coupling': joint and other_joint must differ, both are 2",
        ),
        (
            OWN + "reference: {places: [[0, 0, 0], [0.1, 0.1, 0.1]]}\n",
            "reference.places belongs to kind: places; this reference is of kind paper",
        ),
    ],
)
def test_faults_are_told_in_one_line(tmp_path, text, message):
    with pytest.raises(ScenarioError, match=message) as caught:
        load(tmp_path, text)
    assert "mine.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_names_are_told():
    with pytest.raises(ScenarioError, match="no such scenario"):
        load_tracking("nowhere.yaml")
    with pytest.raises(ScenarioError, match="there are: dwell, paper, quick"):
        load_plan("huge")
    with pytest.raises(ScenarioError, match="there are: scara, three_axis"):
        load_plant("puma")


def test_the_diagram_to_copy_follows_its_reference_better_with_a_model(capsys):
    script = runpy.run_path(str(scenario_path("three_axis_tracking").with_name("closed_loop.py")))
    script["main"](["--seconds", "0.3"])
    alone, fed = (
        [float(word) for word in line.replace("°", "").split()[-3:]]
        for line in capsys.readouterr().out.splitlines()
    )
    assert all(with_model < 0.1 * without for with_model, without in zip(fed, alone, strict=True))


def test_what_a_file_leaves_out_is_as_in_python():
    given, instruments = PlantData(), Instruments()
    for name in ("encoder_counts", "prismatic_lead", "torque_noise"):
        assert getattr(given, name) == getattr(instruments, name)
    arm = load_plant("three_axis")
    assert given.time_step == PlantConfig(arm.config.friction, arm.config.ranges).time_step


def test_the_page_has_every_field_of_an_own_plant_and_its_example_is_one(tmp_path, repository):
    page = (repository / "docs" / "scenarios.md").read_text(encoding="utf-8")
    section = page.partition("## A plant of your own")[2].partition("\n## ")[0]
    for kind in (PlantData, FrictionData, RangesData):
        for field in kind.__struct_fields__:
            assert f"`{field}`" in section, field
    example = section.partition("```yaml\n")[2].partition("```")[0]
    (tmp_path / "mine.yaml").write_text(
        f"{example}reference: {{kind: fourier, duration: 8.0}}\n", encoding="utf-8"
    )
    scenario = load_tracking(tmp_path / "mine.yaml", arm=load_arm("three_axis", tip="link_2"))
    assert [f.stribeck_velocity for f in scenario.plant.config.friction] == [0.1, 0.1]


@pytest.mark.parametrize("key", ["static_settle", "velocity_settle"])
def test_a_segment_settles_for_more_than_ten_samples(key, tmp_path, monkeypatch):
    path = tmp_path / "collection.yaml"
    monkeypatch.setattr(scenarios, "scenario_path", lambda name: path)
    other = {"static_settle": "velocity_settle", "velocity_settle": "static_settle"}[key]
    for seconds, told in ((0.1, True), (0.0999, True), (0.1001, False)):
        path.write_text(f"mine: {{rate: 100.0, {key}: {seconds}, {other}: 1.0}}\n")
        if told:
            with pytest.raises(ScenarioError, match=f"mine: {key} must be above 10 sample periods, 0.1 s"):
                load_plan("mine")
        else:
            assert getattr(load_plan("mine"), key) == seconds


def test_an_own_plant_without_friction_is_the_arm_that_collect_simulates(tmp_path):
    arm = tmp_path / "arm.urdf"
    arm.write_text(urdf_path("scara").read_text())
    stated = "own_plant: {arm: arm.urdf}\nreference: {kind: fourier, duration: 5.0}\nscore: []\n"
    assert load(tmp_path, stated).plant.config.friction == plant_for(arm).config.friction
