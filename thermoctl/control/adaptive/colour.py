"""Coloured noise: what is alike from one sample to the next, as a hum is.

Filters take the noise of a reading for white. A hum of a tenth of a kelvin is then found again at
every sample, as if it were news, and some lag explains it better than the true one. What white
noise cannot do is to leave innovations that are alike from one sample to the next.

Implements section 9 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from thermoctl.control.adaptive.constants import Hearing
from thermoctl.quantities import clamp

START_K2 = 0.001
"""Variance of the innovations at the start, in K²."""
LEAST_K2 = 1e-5
"""Least variance that an innovation is compared with, in K²."""
_MOST = 3.0  # standard deviations that one innovation counts as, at most
_FIRST = 5.0  # samples that the start is worth


class Colour(NamedTuple):
    """How much the innovations of the likeliest hypothesis are alike.

    Parameters
    ----------
    heard : int
        How many there were.
    last_k : float
        The last one, limited to three standard deviations.
    mean_k, product, square : float
        Means of one, in K, of the product of two in a row, and of the square of one, in K^2.
    share : float
        How much of them is colour, in [0, 1]: their correlation beyond what is taken for white.
    variance : float
        Variance of the noise that is not white, in K^2: 0 where all of it is.
    most : float
        The greatest factor so far by which that made the noise larger.
    """

    heard: int = 0
    last_k: float = 0.0
    mean_k: float = 0.0
    product: float = 0.0
    square: float = START_K2
    share: float = 0.0
    variance: float = 0.0
    most: float = 1.0

    def after(self, nu: float, white: float, hearing: Hearing) -> Colour:
        """Return the colour after one more innovation.

        What is off to one side for long is taken out: that is a plant unlike the hypothesis.

        Parameters
        ----------
        nu : float
            The innovation, in K.
        white : float
            Variance of the white part of the noise, in K^2.
        hearing : Hearing
            What is taken for white, how much the rest counts, and for how long it is kept.
        """
        n, last_k, mean_k, product, square, _, _, most = self
        if nu * nu > _MOST * _MOST * square:
            limit = _MOST * math.sqrt(max(square, LEAST_K2))
            nu = clamp(nu, -limit, limit)
        kept, most_kept = n + _FIRST, hearing.colour_samples
        rate = 1.0 / (most_kept if most_kept < kept else kept)
        mean_k += (nu - mean_k) * rate
        product += (nu * last_k - product) * rate
        square += (nu * nu - square) * rate
        aside = mean_k * mean_k
        alike, all_k2, taken = product - aside, square - aside, hearing.white
        if alike <= taken * all_k2:
            return Colour(n + 1, nu, mean_k, product, square, 0.0, 0.0, most)
        share = min((alike / all_k2 - taken) / (1.0 - taken), 1.0)
        variance = hearing.colour_times * share * all_k2
        most = max(most, 1.0 + variance / max(white, LEAST_K2))
        return Colour(n + 1, nu, mean_k, product, square, share, variance, most)

    @property
    def news(self) -> float:
        r"""What a sample is worth beside one of white noise, in [0, 1].

        :math:`(1 - \rho) / (1 + \rho)`, by which a mean of n samples that go over into each other
        by :math:`\rho` is as good as one of fewer that do not.
        """
        return (1.0 - self.share) / (1.0 + self.share)


WHITE = Colour()
"""Before the first innovation."""
