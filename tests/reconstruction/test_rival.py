"""Base parameters take over where the double feature set leaves much more, if the arm's geometry is right."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, friction, measured, rigid_torque, three_axis

from armloop.arm import Arm
from armloop.errors import ExcitationError
from armloop.log import MotionLog
from armloop.progress import silent
from armloop.reconstruction.data import Data
from armloop.reconstruction.options import Options
from armloop.reconstruction.reconstruct import default_conditioning
from armloop.reconstruction.rigid_body import rigid_body
from armloop.reconstruction.rival import Attempt, better
from armloop.reconstruction.stepwise import stepwise_on
from armloop.regression.sparse import Sparse
from armloop.signals import condition

OPTIONS = Options(max_order=1, standard_errors=False)


def a_run(seed: int) -> MotionLog:
    motion = fourier_motion(30.0, 125.0, seed)
    tau = rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + friction(motion.v)
    return measured(motion, tau, seed)


LOGS = [a_run(1), a_run(2)]


def attempt(library: str, arm: Arm) -> Attempt:
    how = default_conditioning(library)
    data = Data.of(condition(LOGS, how), OPTIONS)
    if library == "rigid-body":
        chunk = data.reference
        return Attempt(library, how, data, rigid_body(arm, chunk.samples, chunk.held_out, OPTIONS, silent))
    return Attempt(library, how, data, stepwise_on(arm, data, OPTIONS, silent))


@pytest.fixture(scope="module")
def poor() -> Attempt:
    """Waves of the first order alone cannot describe this arm."""
    return attempt("double-feature-set", three_axis())


def test_base_parameters_take_over_and_a_note_says_so(poor: Attempt) -> None:
    assert poor.may_have_rival
    taken = better(poor, lambda library: attempt(library, three_axis()))
    assert taken.library == "rigid-body" and "rigid-body was taken" in taken.found.notes[0]
    assert "--library double-feature-set" in taken.found.notes[0]


def test_they_do_not_where_the_geometry_is_wrong(poor: Attempt) -> None:
    frames = three_axis().X_PF.copy()
    frames[1:, :3, :3] = frames[1:, :3, :3] @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    crooked = replace(three_axis(), X_PF=frames)
    assert better(poor, lambda library: attempt(library, crooked)) is poor


def test_they_do_not_where_they_are_not_determined(poor: Attempt) -> None:
    def refused(library: str) -> Attempt:
        raise ExcitationError("the motion leaves 9 of 12 inertial parameters undetermined")

    assert better(poor, refused) is poor


def test_samples_that_are_no_time_series_have_no_rival(poor: Attempt) -> None:
    assert not replace(poor, conditioning=replace(poor.conditioning, cutoff_hz=0.0)).may_have_rival


def test_what_only_the_double_feature_set_knows_asks_for_it() -> None:
    assert not Options(folds=4, physical=False).of_double_feature_set
    assert Options(sparse=Sparse("lasso")).of_double_feature_set and OPTIONS.of_double_feature_set
