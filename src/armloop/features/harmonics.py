"""Product-to-sum identities: products of sines and cosines as sums of waves.

With sin x = (e^ix - e^-ix) / 2i and cos x = (e^ix + e^-ix) / 2 a product of sin k·q and cos k·q is a sum of few
exponentials e^(i k·q), that is of waves cos k·q and sin k·q: sin q1 cos q1 = sin(2 q1) / 2. What a model evaluates at
every sample is then one sine per wave instead of one product per term.
"""

from __future__ import annotations

from collections.abc import Iterable

Wave = tuple[int, ...]


def waves_of(factors: Iterable[tuple[Wave, bool]], n: int) -> dict[tuple[Wave, bool], float]:
    """The waves of a product.

    Args:
        factors: the wave vector k (n,) of each factor, and whether it is a sine.
        n: number of joints.

    Returns:
        The weight of each (k, sine); of a wave and its negative only the one that starts with a positive entry.
        The empty product is the cosine of nothing.
    """
    terms: dict[Wave, complex] = {(0,) * n: 1.0}
    for wave, sine in factors:
        # sine: e^ix / 2i - e^-ix / 2i; cosine: e^ix / 2 + e^-ix / 2
        ahead, back = (-0.5j, 0.5j) if sine else (0.5, 0.5)
        product: dict[Wave, complex] = {}
        for k, c in terms.items():
            for sign, half in ((1, ahead), (-1, back)):
                key = tuple(a + sign * b for a, b in zip(k, wave, strict=True))
                product[key] = product.get(key, 0.0) + half * c
        terms = product
    found: dict[tuple[Wave, bool], float] = {}
    for k, c in terms.items():
        lead = next((x for x in k if x), 0)
        if lead >= 0:  # c e^ix + its conjugate = 2 Re c cos x - 2 Im c sin x
            twice = 2.0 if lead else 1.0
            for sine, weight in ((False, twice * c.real), (True, -twice * c.imag)):
                if weight and (lead or not sine):
                    found[k, sine] = weight
    return found
