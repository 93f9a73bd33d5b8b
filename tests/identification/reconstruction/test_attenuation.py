"""Known noise levels take the attenuation out of every step's coefficients, the inherited ones included."""

import numpy as np
import pytest

from armloop.data.signals import Conditioning
from armloop.drake.experiments.scenarios import load_plant
from armloop.experiment.sampling import inverse_dynamics_samples
from armloop.identification.reconstruction import Options, reconstruct
from armloop.robot.arm import load_arm

SNR = (60.0, 30.0, 15.0)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_known_noise_is_corrected(seed):
    arm, ranges = load_arm("scara"), load_plant("scara").config.ranges
    counts = (500, 2000, 4000)
    logs = list(inverse_dynamics_samples(arm, ranges, counts, seed, SNR).values())
    exact = inverse_dynamics_samples(arm, ranges, counts, seed + 100)["varying"]
    errors = []
    for snr in (None, SNR):
        options = Options(max_order=1, snr=snr, parts=False, standard_errors=False)
        model = reconstruct(logs, arm, conditioning=Conditioning(cutoff_hz=0.0), options=options).model
        tau = np.array([model.feedforward(exact.q[k], exact.v[k], exact.vdot[k]) for k in range(200)])
        errors.append(np.sqrt(np.mean((tau - exact.tau[:200]) ** 2, axis=0)))
    plain, corrected = errors
    assert (corrected < 0.5 * plain).all()


def test_the_order_of_a_support_does_not_matter():
    from armloop.data.signals import preprocess
    from armloop.features.angle_sums import AngleSums
    from armloop.features.wave_moments import WaveProducts
    from armloop.identification.reconstruction.attenuation import without_attenuation
    from armloop.identification.reconstruction.data import Data
    from armloop.identification.reconstruction.found import Found
    from armloop.identification.reconstruction.sums import Choice, Columns
    from armloop.identification.reconstruction.trials import Fit
    from armloop.laws.friction import FrictionTerm

    arm, ranges = load_arm("scara"), load_plant("scara").config.ranges
    logs = list(inverse_dynamics_samples(arm, ranges, (50, 200, 400), 0, SNR).values())
    data = Data.of(preprocess(logs, Conditioning(cutoff_hz=0.0)), Options())
    library = AngleSums(tuple(map(bool, arm.revolute)), 1, 1, "acceleration")
    columns = Columns(WaveProducts(library.factors, library.index), ((FrictionTerm("viscous"),),) * arm.n)
    choice = Choice(None, (1, 2, 3), Found(arm, friction=[[] for _ in arm.joints]))
    support = np.array([1, 3, 6, library.size])
    mixed = np.array([2, 0, 3, 1])

    def corrected(support):
        fits = [Fit(support, np.zeros(len(support))) for _ in arm.joints]
        return [fit.beta for fit in without_attenuation(data, choice, columns, fits, SNR)]

    for straight, shuffled in zip(corrected(support), corrected(support[mixed]), strict=True):
        assert np.abs(straight).max() > 0
        np.testing.assert_allclose(shuffled, straight[mixed], rtol=1e-9, atol=1e-12)
