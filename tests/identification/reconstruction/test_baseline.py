"""The baseline a later run is weighed by comes from the condition that the model explains worst."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from synthetic import fourier_motion, measured, rigid_torque, three_axis

from armloop.data.motion import Motion, Samples
from armloop.identification.reconstruction import Options, reconstruct
from armloop.identification.reconstruction.data import Chunk
from armloop.identification.reconstruction.tally import Tally
from armloop.laws.friction import FrictionLaw
from armloop.model import ReconstructedModel
from armloop.model.components import RigidBody
from armloop.robot.kinematics import nominal_parameters


def test_easy_data_do_not_make_the_baseline_look_better():
    arm = three_axis()
    body = RigidBody(nominal_parameters(arm), ("m1",), np.ones(1))
    model = ReconstructedModel(arm, (body,), FrictionLaw(((), (), ())))
    q, v, vdot = np.random.default_rng(1).uniform(-1, 1, (3, 400, 3))
    motion = Motion(np.arange(400.0), q, v, vdot, np.array([0]))
    labels = np.repeat([1, 3], 200)
    error = np.where(labels == 3, 0.5, 0.01)[:, None]
    samples = Samples(motion, rigid_torque(arm, q, v, vdot) + error, np.ones((400, 3), dtype=bool), 1.0)
    held_out = np.arange(400) % 2 == 0
    chunk = Chunk.of(samples, Options(), held_out=held_out)
    sorted_out = Tally.of(chunk, model, lambda motion: labels)
    assert sorted_out.baseline()["rmse"] == pytest.approx([0.5] * 3)
    together = Tally.of(chunk, model, None).baseline()["rmse"]
    assert together == pytest.approx([np.sqrt((0.5**2 + 0.01**2) / 2)] * 3)
    assert Tally.of(chunk, model, None).blocks.shape == (0, 2, 3)  # no time series: no blocks
    filtered = replace(chunk, samples=replace(samples, cutoff_hz=10.0))
    # of the held-out samples, though others are not, but for the first, which the filter has from before the run
    blocks = Tally.of(filtered, model, None).blocks
    assert blocks[:, 1].sum(axis=0) == pytest.approx([199.0] * 3)
    # of all samples, those fitted to included, whichever were held out
    some = Chunk.of(samples, Options(), held_out=labels == 1)
    whole = Tally.fitted(some, model, None, 10.0)
    assert whole.samples == 400 and whole.baseline()["rmse"] == pytest.approx(together)


def test_the_baseline_is_weighed_by_all_of_the_data(monkeypatch):
    motion = fourier_motion(15.0, 125.0, 3)
    log = measured(motion, rigid_torque(three_axis(), motion.q, motion.v, motion.vdot) + motion.v, 3, 0.01)
    asked = []
    monkeypatch.setattr(
        sys.modules[
            "armloop.identification.reconstruction.reconstruct"
        ],  # the function has its module's name
        "at_least",
        lambda baseline, fitted: asked.append((baseline, fitted)) or {**baseline, "rmse": [9.9] * 3},
    )
    options = Options(parts=False, standard_errors=False)
    model = reconstruct([log], three_axis(), library="rigid-body", options=options).model
    assert model.baseline["rmse"] == [9.9] * 3
    ((held_out, fitted),) = asked
    assert fitted.samples > 3 * held_out["samples"] and held_out["samples"] == model.baseline["samples"]
