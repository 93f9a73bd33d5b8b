"""Options of a reconstruction, and what it reports back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from armloop.regression.sparse import Sparse


@dataclass(frozen=True)
class Options:
    """Settings of a reconstruction.

    Attributes:
        sparse: how terms are selected.
        max_order: largest N1 tried in each step.
        max_candidates: N1 is not raised beyond this many independent candidates.
        folds: the data are dealt into so many folds by blocks; one is held out from everything and scored
            at the end, one more chooses the orders.
        block_seconds: longest block.
        correlation_seconds: how long what a plain model leaves remembers; samples nearer than that speak for
            or against physics as one does.
        seed: of k-means.
        snr: signal-to-noise ratios in dB of q, v and v̇ of samples that are no time series, where they are known:
            coefficients are corrected for the noise after the terms are chosen.
        physical: keep friction from driving, and M(q) positive definite unless the data contradict that, where the
            library knows how to.
        friction: the friction laws that may be chosen, by their names
            (:data:`armloop.laws.friction.FRICTION_LAWS`); None for all. The double feature set has its own.
        insist: keep M(q) positive definite even then.
        standard_errors: estimate those of the coefficients, which takes longer than the coefficients do.
        parts: tell what of the residual a flexible regression still predicts.
        torque_lag: seconds by which the torque is recorded later than the motion; None where nobody knows, and it is looked
            for.
    """

    sparse: Sparse = field(default_factory=Sparse)
    max_order: int = 4
    max_candidates: int = 1400
    folds: int = 5
    block_seconds: float = 1.0
    correlation_seconds: float = 0.0
    seed: int = 0
    snr: tuple[float, float, float] | None = None
    physical: bool = True
    friction: tuple[str, ...] | None = None
    insist: bool = False
    standard_errors: bool = True
    parts: bool = True
    torque_lag: float | None = None

    @property
    def of_double_feature_set(self) -> bool:
        """Whether something is set that only the double feature set knows."""
        own = (self.sparse, self.max_order, self.max_candidates, self.snr)
        usual = Options()
        return own != (usual.sparse, usual.max_order, usual.max_candidates, usual.snr)


@dataclass
class StepReport:
    """One step as ``armloop reconstruct --json`` shows it.

    Attributes:
        step: 1, 2, 3.
        orders: [N1, N2]; None where a library has no orders.
        candidates: size of the paper's library at these orders; ``independent``: those that were regressed,
            its full-rank basis without what an earlier step owns.
        terms: number of terms kept per joint.
        samples: samples the step was fitted on, per joint.
        trials: (orders, held-out error relative to the torque) of every order tried.
    """

    step: int
    orders: list[int] | None
    candidates: int
    independent: int
    terms: list[int]
    samples: list[int]
    trials: list[tuple[list[int], float]] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready values."""
        trials = [{"orders": orders, "held_out": error} for orders, error in self.trials]
        return {**self.__dict__, "trials": trials}
