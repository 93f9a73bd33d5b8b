"""Intervals from blocks cover, those that take samples as independent do not."""

from armloop_paper.coverage import coverage_study
from armloop_paper.simulated import Disturbance, collection


def test_intervals_cover_under_correlated_errors():
    (result,) = coverage_study(
        simulations=6,
        seed=3,
        disturbances=[Disturbance("coloured", coloured=0.02)],
        jointly=True,
        design=collection(3, poses=10, segments=24, seconds=24.0),
    )
    assert sum(result.coefficients.values()) == 5 + 31 + 15 + 4 * 3
    total = sum(result.coefficients.values())
    blocks = sum(result.blocks[k] * n for k, n in result.coefficients.items()) / total
    independent = sum(result.independent[k] * n for k, n in result.coefficients.items()) / total
    assert blocks > 0.88
    assert independent < 0.75
