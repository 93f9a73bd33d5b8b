"""What the paper leaves open about its noise and its regression, as choices that can be tried.

Eq. (32) prints min ‖τ − YΞ‖₂ + λ‖Ξ‖₁: neither whether the norm is squared and divided by the number m of samples,
nor whether columns are scaled, nor when the solver stops. The text adds "Gaussian White noise with SNRs of …" without
the power that the ratio refers to, nor how the states were drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armloop.data.log import MotionLog
from armloop.data.motion import Motion
from armloop.experiment.excitation import fourier_reference
from armloop.experiment.sampling import CONDITIONS, inverse_dynamics_samples
from armloop.util.arrays import Array
from armloop_paper.experiments import STEPS, Experiment

#: The penalised error, and by what λ is multiplied to give the weight of ‖Ξ‖₁ beside ½‖τ − YΞ‖².
OBJECTIVES = ("‖r‖²/2m", "‖r‖²/m", "½‖r‖²", "‖r‖²", "‖r‖")
_TRAJECTORIES = 10
_NOISE_WORDS = {"joint": "noise by joint", "unit": "noise of unit power", "record": "noise at rest too"}


@dataclass(frozen=True)
class Reading:
    """One way to read the recipe.

    The defaults are those of the reproduction: Eq. (32) literally, norm not squared, solved to convergence, noise as
    MATLAB measures it (the paper simulates in MATLAB). Of the readings tried they come closest to Fig. 5.
    """

    objective: str = "‖r‖"  # one of OBJECTIVES, + λ‖Ξ‖₁
    scaled: bool = False  # columns are scaled to unit RMS before λ acts on their coefficients
    early: bool = False  # the solver stops after 1,000 sweeps (scikit-learn's default), not at convergence
    # the signal power that the ratio refers to: each joint's own; the mean over the whole matrix of signals of one kind,
    # what MATLAB's awgn(x, snr, "measured") takes; unit power, what awgn(x, snr) takes; or that of the whole record
    noise: str = "matrix"
    sampling: str = "states"  # random in the ranges; or along Fourier-series trajectories (Eq. 31)
    factor: float = 1.0  # λ is taken times this: 1 for the λ that is printed

    def weight(self, penalty: float, samples: int) -> float:
        """λ in front of ‖Ξ‖₁ where the error is ½‖r‖²; for the norm not squared times ‖r‖."""
        factors = dict(zip(OBJECTIVES, (samples, samples / 2, 1.0, 0.5, 1.0), strict=True))
        return self.factor * penalty * factors[self.objective]

    @property
    def label(self) -> str:
        """The reading in a few words."""
        times = "" if self.factor == 1.0 else f"{self.factor:g} "
        parts = [f"{self.objective} + {times}λ‖Ξ‖₁"]
        parts += ["unit columns"] if self.scaled else []
        parts += ["stopped early"] if self.early else []
        parts += [_NOISE_WORDS[self.noise]] if self.noise != "matrix" else []
        parts += ["sampled along trajectories"] if self.sampling != "states" else []
        return ", ".join(parts)


def collected(
    experiment: Experiment, snr: tuple[float, float, float] | None, seed: int, reading: Reading
) -> dict[str, MotionLog]:
    """One draw of the data: static, constant-velocity and varying samples with noise in q, v and vdot.

    Torques are exact, as in the paper. The seed draws the states and the noise.
    """
    exact = inverse_dynamics_samples(experiment.arm, experiment.ranges, experiment.counts, seed)
    if reading.sampling == "trajectories":
        exact["varying"] = _along_trajectories(experiment, seed)
    if snr is None:
        return exact
    rng = np.random.default_rng([seed, 1])
    signals = {name: (log.q, log.v, np.asarray(log.vdot)) for name, log in exact.items()}
    whole = [np.concatenate([own[k] for own in signals.values()]) for k in range(3)]
    noisy = {}
    for name in CONDITIONS:
        log = exact[name]
        q, v, vdot = (
            x + rng.standard_normal(x.shape) * _deviation(x, level, reading.noise, everything)
            for x, level, everything in zip(signals[name], snr, whole, strict=True)
        )
        noisy[name] = MotionLog(log.time, q, v, log.tau, vdot, name=name)
    return noisy


def _deviation(x: Array, snr: float, noise: str, whole: Array) -> Array:
    """(n,) standard deviation of the noise of one condition's signals x, part of those of all conditions."""
    power = np.mean(x**2, axis=0)
    if noise == "matrix":
        power = np.full_like(power, power.mean())
    elif noise == "unit":
        power = np.full_like(power, float(power.any()))
    elif noise == "record":
        power = np.full_like(power, np.mean(whole**2))
    return np.asarray(np.sqrt(power * 10.0 ** (-snr / 10.0)))


def _along_trajectories(experiment: Experiment, seed: int) -> MotionLog:
    """Ten runs one after the other, each stamped with its own time: v is to be the rate of q, as in any log."""
    count = experiment.counts[STEPS.index("step3")]
    parts = []
    for k in range(_TRAJECTORIES):
        reference = fourier_reference(experiment.ranges, 20.0, 1000 * seed + k)
        share = count // _TRAJECTORIES + (k < count % _TRAJECTORIES)
        instants = np.linspace(2.0, 20.0, share)
        parts.append((100.0 * k + instants, *reference.evaluate(instants)))
    time, q, v, vdot = (np.concatenate(column) for column in zip(*parts, strict=True))
    tau = experiment.torque(Motion(time, q, v, vdot))
    return MotionLog(time, q, v, tau, vdot, name="varying")


#: One choice changed at a time; the first is the default.
READINGS = (
    Reading(),
    Reading("‖r‖²", early=True),
    Reading("½‖r‖²"),
    Reading("‖r‖²/m"),
    Reading("‖r‖²/2m"),
    Reading(scaled=True),
    Reading(noise="joint"),
    Reading(noise="unit"),
    Reading(noise="record"),
    Reading(sampling="trajectories"),
    Reading("½‖r‖²", factor=1e-4, early=True),
)
