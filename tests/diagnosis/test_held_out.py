"""What judges an effect was not fitted, and a richer effect is not lost to a simple one that nearly serves."""

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque

from armloop.data.signals import preprocess
from armloop.diagnosis import diagnose
from armloop.diagnosis.evidence import FOLDS, Evidence
from armloop.diagnosis.fit import Shape, deviate, fit
from armloop.diagnosis.search import search
from armloop.diagnosis.trials import Hypotheses, Known
from armloop.laws.effects import effect, hypotheses
from armloop.laws.friction import FrictionLaw, FrictionTerm
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.arm import load_arm
from armloop.robot.kinematics import nominal_parameters, regressor
from armloop.util.progress import silent


def exact(name: str) -> ReconstructedModel:
    arm = load_arm(name)
    law = tuple((FrictionTerm("viscous", 1.0),) for _ in arm.joints)
    body = RigidBody(nominal_parameters(arm), ("m1",), np.ones(1))
    rmse = [0.01] * arm.n
    return ReconstructedModel(arm, (body,), FrictionLaw(law), baseline={"rmse": rmse})


def test_a_ripples_order_for_judging_a_fold_does_not_see_that_fold():
    model = exact("three_axis")
    motion = fourier_motion(40.0, 100.0, 3)
    tau = rigid_torque(model.arm, motion.q, motion.v, motion.vdot) + motion.v
    samples = preprocess([measured(motion, tau, 3)], model.conditioning)
    evidence = Evidence.of(model, samples, hypotheses(model.arm))
    ripple = effect("torque_ripple", 2)

    def chosen(order_in_fold: tuple[int, int]) -> tuple[float, ...]:
        # another order in each fold: only what was fitted outside a fold may decide for it
        residual = np.zeros_like(samples.tau)
        for k, order in enumerate(order_in_fold):
            mine = evidence.fold == k
            residual[mine, 1] = 0.2 * np.sin(order * samples.motion.q[mine, 1])
        current = fit(evidence, residual, [], [])
        trial = Known(evidence, residual, current).trial(ripple)
        assert trial is not None
        return trial.shapes[-1].without

    assert FOLDS == 2
    assert chosen((6, 11)) == (11.0, 6.0)
    assert chosen((9, 11)) == (11.0, 9.0)


def slow_friction_in_one_fold(at_fold_0: float) -> tuple[Evidence, np.ndarray, np.ndarray]:
    """A run with viscous friction of joint 2 by 3 N·m·s/rad outside fold 0 and by another coefficient in it."""
    model = exact("three_axis")
    motion = fourier_motion(40.0, 100.0, 3)
    tau = rigid_torque(model.arm, motion.q, motion.v, motion.vdot) + motion.v
    samples = preprocess([measured(motion, tau, 3)], model.conditioning)
    evidence = Evidence.of(model, samples, hypotheses(model.arm))
    column = np.zeros_like(samples.tau)
    column[evidence.kept] = evidence.columns(effect("viscous_friction", 2), 0.0)[:, :, 0]
    return evidence, column, np.where(evidence.fold == 0, at_fold_0, 3.0)[:, None] * column


def test_what_judges_a_fold_was_not_fitted_to_it():
    evidence, column, residual = slow_friction_in_one_fold(1.0)
    found = fit(evidence, residual, [effect("viscous_friction", 2)], [Shape.fixed(0.0)])
    of_one = evidence.stack(column, []).y
    np.testing.assert_allclose(
        found.held_out, np.where(found.stacked.fold == 0, -2.0, 2.0) * of_one, atol=1e-5
    )


def test_a_shape_for_judging_a_fold_does_not_see_what_other_effects_are_in_it():
    """Nor through effects found earlier: what they leave elsewhere depends on where they were fitted."""
    chosen = []
    for at_fold_0 in (3.0, 40.0):
        evidence, _, residual = slow_friction_in_one_fold(at_fold_0)
        residual[:, 1] += 0.2 * np.sin(11 * evidence.samples.motion.q[:, 1])
        current = fit(evidence, residual, [effect("viscous_friction", 2)], [Shape.fixed(0.0)])
        trial = Known(evidence, residual, current).trial(effect("torque_ripple", 2))
        assert trial is not None
        chosen.append(trial.shapes[-1].without[0])
    assert chosen == [11.0, 11.0]


def test_a_fold_is_judged_with_what_the_other_folds_showed_alone():
    model = exact("three_axis")
    motion = fourier_motion(40.0, 100.0, 3)
    samples = preprocess([measured(motion, np.zeros_like(motion.q), 3)], model.conditioning)
    evidence = Evidence.of(model, samples, hypotheses(model.arm))
    residual = np.zeros_like(samples.tau)
    residual[evidence.fold == 0, 1] = 0.2  # there in one fold, absent in the other
    offset = effect("torque_offset", 2)
    found = fit(evidence, residual, [offset], [Shape.fixed(offset.shapes(evidence.context)[0])])
    stacked, size = found.stacked, 0.2 / evidence.scale[1]
    for fold, left in ((0, size), (1, -size)):
        rows = (stacked.fold == fold) & (stacked.joint == 1)
        assert rows.sum() > 100
        np.testing.assert_allclose(found.held_out[rows], left, rtol=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("mass", [0.1, 0.3])
def test_a_load_on_an_upright_slide_is_no_torque_offset(mass):
    # On the SCARA arm a load is almost only a constant force on the slide; its inertia tells it apart.
    model = exact("scara")
    motion = fourier_motion(50.0, 100.0, 5, model.arm)
    c = np.array([0.02, 0.01, 0.0])
    inertia = mass * (c @ c * np.eye(3) - np.outer(c, c))
    tensor = [inertia[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    load = np.concatenate([[mass], mass * c, tensor])
    tau = rigid_torque(model.arm, motion.q, motion.v, motion.vdot) + motion.v
    tau += regressor(model.arm, motion.q, motion.v, motion.vdot, links=[3]) @ load
    model = ReconstructedModel(
        model.arm, model.components, model.friction, baseline={"rmse": [4e-4, 4e-4, 0.01, 4e-4]}
    )
    found = diagnose(model, [measured(motion, tau, 5, noise=0.002)]).outcome
    assert [f.effect.name for f in found.found] == ["payload"]
    assert found.added()[0].parameters["mass"].value == pytest.approx(mass, rel=0.05)


def test_a_search_dealt_over_processes_finds_the_same_to_the_bit(monkeypatch):
    """Of a part of the run, as events leave it: every process fits what is known for itself."""
    model = exact("three_axis")
    motion = fourier_motion(20.0, 100.0, 3)
    tau = rigid_torque(model.arm, motion.q, motion.v, motion.vdot) + 2 * motion.v + [0.0, 0.0, 5.0] * motion.q
    samples = preprocess([measured(motion, tau, 3)], model.conditioning)
    few = [
        effect(name, joint)
        for name in ("viscous_friction", "coulomb_friction", "joint_spring")
        for joint in (1, 2, 3)
    ]
    monkeypatch.setattr("armloop.diagnosis.trials.hypotheses", lambda arm: few)
    whole = Evidence.of(model, samples, hypotheses(model.arm))
    part = whole.only(whole.rows & (whole.blocks != 3)[:, None])
    outcomes = []
    for jobs in (1, 3):
        with Hypotheses(whole, jobs) as panel:
            outcomes.append(search(part, silent, panel))
    one, three = outcomes
    assert len(one.found) > 1
    assert [(f.effect, f.shape, f.share, f.rivals) for f in one.found] == [
        (f.effect, f.shape, f.share, f.rivals) for f in three.found
    ]
    assert one.after.parameters == three.after.parameters
    np.testing.assert_array_equal(one.after.held_out, three.after.held_out)


def test_the_same_is_tried_once_however_many_searches_ask(monkeypatch):
    """Without an effect, or beside others, a search goes back to what another has tried; of other samples it is new."""
    evidence, _, _ = slow_friction_in_one_fold(2.0)
    few = [effect("viscous_friction", joint) for joint in (1, 2)]
    monkeypatch.setattr("armloop.diagnosis.trials.hypotheses", lambda arm: few)
    told = []
    with Hypotheses(evidence, 1) as panel:
        for known in (
            Known.of(evidence),
            Known.of(evidence),
            Known.of(evidence, few[:1], [Shape.fixed(0.0)]),
        ):
            answer = panel.tried(known, told.append)
            assert panel.tried(known, told.append) is answer
        part = evidence.only(evidence.rows & (evidence.blocks != 1)[:, None])
        others = panel.tried(Known.of(part), told.append, -np.inf)
        assert len(told) == 3 * len(few)
        # of what was tried already nothing is fitted anew that is asked for less
        assert panel.tried(Known.of(part), told.append) is others
    assert len(told) == 3 * len(few)
    assert [t.effect for t in others] == few and others[0].score.error < known.fit.score.error


def test_an_effect_is_as_clear_as_its_clearest_coefficient_or_all_together_by_their_stated_errors():
    evidence, _, residual = slow_friction_in_one_fold(2.0)
    residual = residual + 0.01 * np.random.default_rng(5).normal(size=residual.shape)
    coupling, offset = effect("transmission_coupling", 1, 2), effect("torque_offset", 3)
    found = fit(evidence, residual, [coupling, offset], [Shape.fixed(-1.0), Shape.fixed(0.0)])
    stated = [
        [abs(p[key].value / p[key].std_error) for key in keys]
        for p, keys in zip(found.parameters, (("inertia", "viscous", "coulomb"), ("offset",)), strict=True)
    ]
    assert max(stated[0]) > 2 * min(stated[0])
    clearest = [max(own) for own in stated]
    # of a single coefficient Wald's chi-square is the square of that, of several at least
    assert found.wald[1] == (pytest.approx(clearest[1] ** 2, rel=1e-6), 1)
    assert found.wald[0][1] == 3 and found.wald[0][0] >= (1 - 1e-6) * clearest[0] ** 2
    together = [deviate(*own) for own in found.wald]
    assert found.clear == pytest.approx(
        [max(pair) for pair in zip(clearest, together, strict=True)], rel=1e-6
    )


def test_a_level_that_friction_with_memory_shares_with_dry_friction_does_not_make_it_clear():
    """Of friction with memory and what changes of its level none is known by itself, though what they do is plain: it is
    dry friction.
    """
    evidence, _, residual = slow_friction_in_one_fold(2.0)
    residual = 0.05 * np.random.default_rng(5).normal(size=residual.shape)
    memory = effect("presliding_hysteresis", 1)
    columns = memory.columns(evidence.context, 1e-4)
    assert np.corrcoef(columns[:, 0], columns[:, 2])[0, 1] > 0.99
    residual[:, 0] += 0.1 * (columns[:, 0] + columns[:, 2])
    found = fit(evidence, residual, [memory], [Shape.fixed(1e-4)])
    (p,) = found.parameters
    assert all(abs(p[key].value) < 4 * p[key].std_error for key in ("level", "level_change"))
    assert found.clear[0] < 3 and deviate(*found.wald[0]) > 10
    dry = fit(evidence, residual, [effect("coulomb_friction", 1)], [Shape.fixed(0.0)])
    assert dry.clear[0] > 10
    # where it stretches far enough to be told from a step it is clear by itself
    residual[:, 0] -= 0.1 * (columns[:, 0] + columns[:, 2])
    columns = memory.columns(evidence.context, 0.05)
    residual[:, 0] += 0.2 * columns[:, 0]
    assert fit(evidence, residual, [memory], [Shape.fixed(0.05)]).clear[0] > 5
