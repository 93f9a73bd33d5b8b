"""Known noise levels take the attenuation out of every step's coefficients, the inherited ones included."""

import numpy as np
import pytest

from armloop.arm import load_arm
from armloop.drake_systems.scenarios import load_plant
from armloop.reconstruction import Options, reconstruct
from armloop.sampling import inverse_dynamics_samples
from armloop.signals import Conditioning

SNR = (60.0, 30.0, 15.0)


@pytest.mark.parametrize("seed", range(2))
def test_known_noise_is_corrected(seed):
    arm, ranges = load_arm("scara"), load_plant("scara").config.ranges
    counts = (500, 2000, 4000)
    logs = list(inverse_dynamics_samples(arm, ranges, counts, seed, SNR).values())
    exact = inverse_dynamics_samples(arm, ranges, counts, seed + 100)["varying"]
    errors = []
    for snr in (None, SNR):
        options = Options(max_order=1, snr=snr)
        model = reconstruct(logs, arm, conditioning=Conditioning(cutoff_hz=0.0), options=options).model
        tau = np.array([model.feedforward(exact.q[k], exact.v[k], exact.vdot[k]) for k in range(200)])
        errors.append(np.sqrt(np.mean((tau - exact.tau[:200]) ** 2, axis=0)))
    plain, corrected = errors
    assert (corrected < 0.5 * plain).all()
