"""Where no library is asked for, the best that is an arm is taken, on blocks that judge nothing else."""

import warnings
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import conditioned_samples, fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.data.log import MotionLog
from armloop.data.signals import preprocess
from armloop.dynamics import check_physics
from armloop.dynamics.physics import PhysicsChecks
from armloop.features.lagrangian import candidates as energies
from armloop.identification.reconstruction import Options, Reconstruction, reconstruct
from armloop.identification.reconstruction.data import Chunk, Data
from armloop.identification.reconstruction.libraries import (
    LIBRARIES,
    Attempt,
    Contender,
    candidates,
    check_suits,
    choose,
    comparison_notes,
    contender,
    left_behind,
    named,
)
from armloop.identification.reconstruction.rigid_body import RigidBodyLibrary
from armloop.identification.reconstruction.stepwise import stepwise_on
from armloop.model import ReconstructedModel
from armloop.model.components import SparseTerms
from armloop.regression.sparse import Sparse
from armloop.reports.tables import libraries_table
from armloop.robot.arm import Arm
from armloop.util.errors import ExcitationError, InputError, InputWarning
from armloop.util.progress import silent

OPTIONS = Options(standard_errors=False)
PLAIN = Options(standard_errors=False, parts=False)
GOOD = PhysicsChecks(0.1, (0.0,), 0.0, 0.0, (0.0,), (0.0,), (0.0,), None)
BAD = replace(GOOD, least=-0.1, negative=0.3)


def a_run(seed: int) -> MotionLog:
    motion = fourier_motion(24.0, 125.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, seed)


@pytest.fixture(scope="module")
def logs() -> list[MotionLog]:
    return [a_run(1), a_run(2)]


@pytest.fixture(scope="module")
def result(logs: list[MotionLog]) -> Reconstruction:
    # low orders: the waves of the first order alone cannot describe this arm, and are quick to regress
    import armloop.identification.reconstruction.stepwise as room

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "_orders", lambda revolute, parts, second, options: ((1, second[-1]),))
        return reconstruct(logs, three_axis(), options=PLAIN)


def entry(
    library: str, nrmse: float, coefficients: int, checks: PhysicsChecks, spread: float = 0.0
) -> Contender:
    noise = spread * np.random.default_rng(len(library)).normal(size=12)
    made = SimpleNamespace()
    kind: Any = SimpleNamespace(name=library)
    return Contender(kind, made, "", (nrmse,), coefficients, coefficients, checks, nrmse**2 + noise)  # type: ignore[arg-type]


def taken(*entries: Contender) -> str:
    (one,) = [entry.name for entry in choose(entries) if entry.chosen]
    return one


def test_all_three_are_compared_and_the_report_says_so(result: Reconstruction) -> None:
    assert [one.name for one in result.libraries] == ["double-feature-set", "rigid-body", "lagrangian"]
    assert result.model.history["library"] == "rigid-body" and "library rigid-body" in result.notes[0]
    answer = result.to_dict()["libraries"]
    assert [one["chosen"] for one in answer] == [False, True, False]
    for one in answer:
        assert one["coefficients"] > 10 and len(one["selection_nrmse"]) == 3
        assert {"passed", "mass_matrix", "friction", "yaw", "faults"} <= set(one["physics"])
    assert check_physics(result.model).passed and answer[1]["physics"]["passed"]


def test_the_table_says_how_far_a_positive_mass_matrix_is_proven() -> None:
    found = {
        0.0: "0.0300",
        0.937: "0.03 (searched; proven positive on 94% of the postures)",
        1.0: "0.03 (proven positive)",
    }
    for share, said in found.items():
        checks = replace(GOOD, least=0.03, certificate="why" if share == 1 else "", proven=share)
        rows = str(libraries_table([entry("a", 0.01, 9, checks)])).splitlines()
        assert any(f"  {said}  " in row for row in rows), rows


def test_what_is_no_arm_is_not_taken_however_little_it_leaves() -> None:
    assert taken(entry("a", 0.01, 9, BAD), entry("b", 0.02, 9, GOOD)) == "b"
    # none is: the best one, with its faults told
    assert taken(entry("a", 0.01, 9, BAD), entry("b", 0.02, 9, BAD)) == "a"
    # and before that the one that is nearest to an arm
    worse = replace(BAD, driving=(0.5, 0.5), driving_at=(1.0, 1.0))
    assert taken(entry("a", 0.01, 9, worse), entry("b", 0.02, 9, BAD)) == "b"


def test_the_simpler_is_taken_where_the_difference_is_within_its_scatter() -> None:
    apart = entry("many", 0.020, 40, GOOD), entry("few", 0.022, 15, GOOD)
    assert taken(*apart) == "many"
    alike = entry("many", 0.020, 40, GOOD, 1e-3), entry("few", 0.0201, 15, GOOD, 1e-3)
    assert taken(*alike) == "few"
    # few, but picked from many
    assert taken(alike[0], replace(alike[1], complexity=60.0)) == "many"
    best, simplest = choose(alike)
    assert "simplest of those that leave as little" in comparison_notes([best, simplest])[0]
    assert "simplest" not in comparison_notes(choose(apart))[0]


def test_a_library_that_the_logs_do_not_carry_is_left_out_with_the_reason() -> None:
    def refused(library: str):
        raise ExcitationError("the motion leaves 9 of 12 inertial parameters undetermined")

    out = contender(named("lagrangian"), refused)
    assert taken(out, entry("b", 0.02, 9, GOOD)) == "b"
    assert out.to_dict() == {"library": "lagrangian", "chosen": False, "refused": out.refused}
    with pytest.raises(InputError, match="lagrangian: the motion leaves 9 of 12"):
        choose([out])


def test_a_library_is_one_object(logs: list[MotionLog], monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever registers one has it chosen by name, compared where it suits, and told what it does not know."""

    class Own(RigidBodyLibrary):
        name = "own"
        own_friction = "its friction is its own"

        def suits(self, arm: Arm) -> bool:
            return arm.n < 3

    monkeypatch.setitem(LIBRARIES, "own", Own())
    found = reconstruct(logs[:1], three_axis(), library="own", options=PLAIN)
    (only,) = found.to_dict()["libraries"]
    assert found.model.history["library"] == "own" and only["library"] == "own" and only["chosen"]
    friction = sum(map(len, found.model.friction.terms))
    assert only["coefficients"] == len(found.model.components[0].values) + friction  # no effect was added
    assert "own" not in [one.name for one in candidates(three_axis(), PLAIN)]
    with pytest.raises(
        InputError, match=r"its friction is its own; laws are chosen with --library rigid-body or lag"
    ):
        reconstruct(logs, three_axis(), library="own", options=replace(PLAIN, friction=("viscous",)))
    with pytest.raises(
        InputError, match=r"method 'sindy' works on the library double-feature-set, not on 'own'"
    ):
        reconstruct(logs, three_axis(), method="sindy", library="own")


def test_a_library_of_more_candidates_than_independent_torques_is_not_tried() -> None:
    """Torque below 5 Hz takes 20 values a second: three joints' in half of one are fewer than the energies' candidates."""
    log = a_run(1)
    short = log.select(slice(0, int(0.5 / log.period)))
    why = named("lagrangian").undetermined(three_axis(), [short], 5.0)
    assert why == f"{energies(three_axis()).count} candidates, but 29 independent values of torque"
    assert named("lagrangian").undetermined(three_axis(), [log], 5.0) == ""
    assert named("rigid-body").undetermined(three_axis(), [short], 5.0) == ""
    note, *_ = comparison_notes(
        [
            Contender(named("rigid-body"), SimpleNamespace(), chosen=True),
            Contender(named("lagrangian"), refused=why),
        ]  # type: ignore[arg-type]
    )
    assert note.startswith(
        "library rigid-body: the only one that the logs can determine; lagrangian not tried ("
    )


def test_what_no_block_judges_is_said_to_be_so() -> None:
    made: Any = SimpleNamespace()
    taken = Contender(named("rigid-body"), made, nrmse=(None, None), chosen=True)
    note, *_ = comparison_notes([taken, Contender(named("lagrangian"), made, nrmse=(None, None))])
    assert note == "library rigid-body: the logs are too short to judge it by; lagrangian not judged"


def test_blocks_choose_the_library_or_judge_the_model_and_neither_is_fitted(logs: list[MotionLog]) -> None:
    samples = preprocess(logs, three_axis_conditioning())
    chunk = Chunk.of(samples, OPTIONS)
    selection, test = chunk.judging("selection"), chunk.judging("test")
    assert selection.any() and test.any() and not (selection & test).any()
    np.testing.assert_array_equal(selection | test, chunk.held_out)
    assert not (chunk.validation & chunk.held_out).any()
    # judges keep away from samples that were fitted or chose
    near = chunk.judging("test", 0.2)
    time, others = samples.motion.time, np.flatnonzero(~test)
    run = np.searchsorted(samples.motion.starts, np.arange(len(time)), side="right")
    for k in np.flatnonzero(near)[::7]:
        same = others[run[others] == run[k]]
        assert np.abs(time[same] - time[k]).min() > 0.2


def three_axis_conditioning():
    from armloop.identification.reconstruction.reconstruct import default_conditioning

    return default_conditioning("rigid-body")


def test_nothing_that_is_chosen_or_fitted_sees_the_blocks_that_judge(
    logs: list[MotionLog], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Torques of the blocks that judge are replaced by noise: not a digit of what judges the libraries changes."""
    seen: dict[bool, list[Contender]] = {}
    original = Chunk.of

    def run(spoil: bool) -> Reconstruction:
        def of(samples, options, first=0, held_out=None):
            chunk = original(samples, options, first, held_out)
            if not spoil:
                return chunk
            rows = chunk.judging("test")
            tau = np.where(
                rows[:, None], 50 * np.random.default_rng(0).normal(size=samples.tau.shape), samples.tau
            )
            return original(replace(samples, tau=tau), options, first, held_out)

        monkeypatch.setattr(Chunk, "of", staticmethod(of))
        found = reconstruct(logs, three_axis(), options=replace(OPTIONS, friction=("coulomb", "viscous")))
        seen[spoil] = found.libraries
        return found

    plain, spoilt = run(False), run(True)
    for a, b in zip(seen[False], seen[True], strict=True):
        assert a.nrmse == b.nrmse and a.chosen == b.chosen
        assert a.attempt is not None and b.attempt is not None
        for one, other in zip(a.attempt.found.components, b.attempt.found.components, strict=True):
            assert one.to_dict() == other.to_dict()
        assert a.attempt.found.friction == b.attempt.found.friction
    assert min(spoilt.held_out.moving["rmse"]) > 20 * max(plain.held_out.moving["rmse"])


def test_a_condition_with_too_few_samples_does_not_end_it() -> None:
    samples = conditioned_samples((400, 400, 400), noise=0.01)
    moving = samples.moving.copy()
    moving[:398, 1] = False  # of the static samples joint 2 has two
    options, nothing = Options(max_order=1), np.zeros(len(moving), dtype=bool)
    data = Data.of(replace(samples, moving=moving), options, nothing)
    found = stepwise_on(three_axis(), data, options, silent)
    (note,) = [note for note in found.notes if "regressed together instead" in note]
    assert "step 1: joint 2 has 2 usable samples, at least 30 are needed" in note
    assert [report.step for report in found.reports] == [1, 2, 3]


def test_checks_find_what_is_no_arm(result: Reconstruction) -> None:
    model = result.model
    body = model.components[0]
    upside = replace(model, components=(replace(body, parameters=-body.parameters),))  # type: ignore[type-var]
    checks = check_physics(upside)
    assert (
        not checks.definite
        and checks.negative > 0.5
        and "M(q) is not positive definite at" in checks.faults()[0]
    )
    law = replace(
        model.friction,
        terms=tuple(
            tuple(replace(t, coefficient=-t.coefficient) for t in terms) if j == 1 else terms
            for j, terms in enumerate(model.friction.terms)
        ),
    )
    drives = check_physics(replace(model, friction=law))
    assert drives.definite and not drives.passive and drives.driving[1] > 0.5 and drives.driving[2] == 0
    assert any("friction drives joint 2" in line for line in drives.faults())


def test_a_double_feature_set_that_turns_with_the_base_or_pulls_unevenly_is_told(
    result: Reconstruction,
) -> None:
    waves = next(one.attempt for one in result.libraries if one.name == "double-feature-set")
    assert waves is not None
    made = waves.model()
    assert isinstance(made, ReconstructedModel)
    checks = check_physics(made)
    assert not checks.passed and checks.faults()


def test_what_only_the_double_feature_set_knows_asks_for_it() -> None:
    assert not Options(folds=4, physical=False).of_double_feature_set
    assert (
        Options(sparse=Sparse("lasso")).of_double_feature_set and Options(max_order=1).of_double_feature_set
    )


def test_what_a_library_does_not_use_is_said() -> None:
    for options in (
        Options(sparse=Sparse("lasso")),
        Options(sparse=Sparse("lasso", penalty=0.1)),
        Options(max_order=2),
    ):
        with pytest.warns(InputWarning, match="rigid-body has none, and they are not used"):
            check_suits(named("rigid-body"), "stepwise", options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_suits(named("double-feature-set"), "stepwise", Options(max_order=2))
        check_suits(named("lagrangian"), "stepwise", Options(physical=False))


def test_libraries_that_suit_the_arm_and_the_question_are_compared() -> None:
    def those(n: int, method: str = "stepwise", **options: Any) -> list[str]:
        arm: Any = SimpleNamespace(n=n)
        return [one.name for one in candidates(arm, Options(**options), method)]

    own, shared = "double-feature-set", ["rigid-body", "lagrangian"]
    assert those(3) == [own, *shared] and those(7) == shared
    # friction laws are of those that have none of their own, orders of the one that has
    assert those(3, friction=("coulomb",)) == shared and those(3, max_order=2) == [own]
    assert those(3, "sindy") == [own]
    # where none would be left they are asked all the same
    assert those(7, "sindy") == those(3, "sindy", friction=("coulomb",)) == [own]


def test_a_library_says_which_others_know_a_method_or_laws() -> None:
    with pytest.raises(
        InputError, match="method 'sindy' works on the library double-feature-set, not on 'rigid"
    ):
        check_suits(named("rigid-body"), "sindy", Options())
    with pytest.raises(InputError, match=r"chosen with --library rigid-body or lagrangian$"):
        check_suits(named("double-feature-set"), "stepwise", Options(friction=("coulomb",)))


def test_coefficients_of_effects_friction_and_bodies_add_up() -> None:
    effects = [SimpleNamespace(parameters={"a": 1, "b": 2}), SimpleNamespace(parameters={"c": 3})]
    terms = SparseTerms(1, np.array([[1], [2]]), np.array([[1.0, 0.0], [2.0, 3.0]]), ())
    found: Any = SimpleNamespace(effects=effects, friction=[[1, 2], [], [3, 4, 5]], components=[terms, terms])
    nothing: Any = None
    attempt = Attempt(nothing, nothing, nothing, found)
    assert attempt.coefficients() == 3 + 5 + 6 and attempt.margin == 0.0


@pytest.mark.parametrize(
    ("shared", "independent", "picked_from"),
    [(True, [70, 60], 60), (False, [70, 60], 2 * 130), (True, [6], 6)],
)
def test_coefficients_that_were_picked_weigh_what_they_were_picked_from(
    shared: bool, independent: list[int], picked_from: int
) -> None:
    """k of p weigh k (1 + ln(p / k)), which is k where none was left out; friction and laws weigh one each."""
    terms = SparseTerms(1, np.ones((6, 1)), np.eye(6)[:, :2] + np.eye(6)[:, 2:4] + np.eye(6)[:, 4:], ())
    found: Any = SimpleNamespace(
        arm=SimpleNamespace(n=2),
        effects=[],
        friction=[[1, 2], []],
        components=[terms],
        reports=[SimpleNamespace(independent=count) for count in independent],
    )
    library: Any = SimpleNamespace(shared=shared)
    nothing: Any = None
    attempt = Attempt(library, nothing, nothing, found)
    assert attempt.coefficients() == 2 + 6
    assert attempt.complexity() == pytest.approx(2 + 6 * (1 + np.log(picked_from / 6)))
    bare = Attempt(library, nothing, nothing, SimpleNamespace(**{**vars(found), "components": []}))  # type: ignore[arg-type]
    assert bare.complexity() == 2


def test_what_leaves_less_but_is_no_arm_is_named() -> None:
    def notes(*others: Contender) -> list[str]:
        chosen = replace(entry("b", 0.02, 9, GOOD), chosen=True)
        return comparison_notes([chosen, *others])

    first, second = notes(entry("a", 0.01, 9, BAD), entry("c", 0.03, 9, BAD), entry("d", 0.01, 9, GOOD))
    assert first.startswith(
        "library b: it leaves 2.00% (nRMSE) on the blocks that choose the library; a 1.00%, c"
    )
    assert second.startswith("a leaves less but is no arm: ")
    nothing: Any = None
    assert len(notes(replace(entry("a", 0.01, 9, GOOD), checks=None))) == 1
    assert Contender(nothing).coefficients == 0


def test_what_leaves_three_times_as_much_as_the_one_taken_is_left_behind() -> None:
    made: Any = SimpleNamespace()
    one, far, near = (
        Contender(named(name), made, nrmse=(error, None))
        for name, error in (("rigid-body", 0.02), ("lagrangian", 0.061), ("double-feature-set", 0.059))
    )
    refused = Contender(named("lagrangian"), refused="why")
    taken = replace(one, chosen=True)
    assert left_behind([far, taken, near, refused]) == [far]


def test_what_is_left_behind_is_not_tried_again_nor_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the other one fails a check now: it was made of the logs as they were taken to be before."""
    wanted, tried = [named("rigid-body"), named("lagrangian")], list[Any]()
    checks: Any = SimpleNamespace(failed=1)
    module = import_module("armloop.identification.reconstruction.reconstruct")
    made = Contender(wanted[0], SimpleNamespace(), nrmse=(0.02,), checks=checks)  # type: ignore[arg-type]
    behind = Contender(wanted[1], SimpleNamespace(), nrmse=(0.2,))  # type: ignore[arg-type]

    def contender(library: Any, attempt: Any) -> Any:
        tried.append(library.name)
        return made

    monkeypatch.setattr(module, "contender", contender)
    ready: Any = SimpleNamespace(few_held_out=lambda conditioning: False)
    (first, second), judged_on = module._compared(wanted, {}, print, ready, [behind])
    assert tried == ["rigid-body"] and judged_on == "test"
    assert first.chosen and second is behind and not second.chosen
