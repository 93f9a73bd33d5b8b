"""Beyond the paper: Stribeck friction by a profile over v_s, against a hundred exponentials (Sect. 4.3)."""

from __future__ import annotations

import numpy as np

from armloop.laws.friction import stribeck_fall
from armloop.reports.html import Section
from armloop.reports.tables import make_table
from armloop_paper.context import Context
from armloop_paper.outcome import Outcome, beyond
from armloop_paper.spread import in_words, spread
from armloop_paper.stribeck import Stribeck, compare_stribeck

#: Eq. (34) with numbers like those of the simulated arm's first joint.
_TRUE = Stribeck(0.724, 0.557, 0.1, 2.65)
_SNR = 40.0
_SAMPLES, _SLOWEST, _FASTEST = 4000, 0.01, 1.57
_FIELDS = {
    "static": "f_s [N·m]",
    "coulomb": "f_c [N·m]",
    "velocity": "v_s [rad/s]",
    "viscous": "f_v [N·m·s/rad]",
}
_WAYS = ("profile", "least squares", "Lasso")


def run(context: Context) -> Outcome:
    """Recover the four parameters from noisy constant velocities, draw by draw."""
    trials = context.map(_trial, list(range(context.draws)), "friction")
    found = {way: np.array([trial[0][way] for trial in trials]) for way in _WAYS}
    rows = []
    for k, (field, label) in enumerate(_FIELDS.items()):
        rows.append([label, getattr(_TRUE, field), *(in_words(found[way][:, k]) for way in _WAYS)])
    ours = {way: spread(values) for way, values in found.items()}
    condition = float(np.median([trial[1] for trial in trials]))
    text = (
        f"Velocities from {_SLOWEST} to {_FASTEST} rad/s in both directions, {_SNR:.0f} dB of noise in velocity and torque, "
        f"{context.draws} draws. The paper regresses each direction on a constant, v and a hundred exponentials; their "
        f"columns have condition {condition:.0e}. Shown is the forward direction."
    )
    headers = ["", "true", "profile over v_s", "exponentials, least squares", "exponentials, Lasso"]
    table = make_table(headers, rows, f"Median (range) of {context.draws} draws")
    return beyond(
        ours,
        f"v_s {in_words(found['profile'][:, 2])} by the profile (true {_TRUE.velocity})",
        Section("Beyond the paper: Stribeck friction", [text], tables=[table]),
    )


def _trial(seed: int) -> tuple[dict[str, list[float]], float]:
    rng = np.random.default_rng(seed)
    speed = np.exp(rng.uniform(np.log(_SLOWEST), np.log(_FASTEST), _SAMPLES))
    v = speed * rng.choice([-1.0, 1.0], _SAMPLES)
    level = _TRUE.coulomb + (_TRUE.static - _TRUE.coulomb) * stribeck_fall(v, _TRUE.velocity)
    tau = level * np.sign(v) + _TRUE.viscous * v
    ratio = 10 ** (-_SNR / 20)
    speed_noise = float(ratio * np.sqrt(np.mean(v**2)))
    noisy = v + speed_noise * rng.standard_normal(_SAMPLES)
    measured = tau + ratio * np.sqrt(np.mean(tau**2)) * rng.standard_normal(_SAMPLES)
    result = compare_stribeck(noisy, measured, speed_noise)
    fits = dict(zip(_WAYS, (result.profile, result.least_squares[0], result.lasso[0]), strict=True))
    return {way: [getattr(fit, field) for field in _FIELDS] for way, fit in fits.items()}, result.condition
