"""Recursive least squares with a fixed and with a variable forgetting factor.

Implements section 2 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass

from thermoctl.estimation.belief import LARGEST, positive, truth
from thermoctl.estimation.recursion import Arithmetic, RecursiveLaw, V


@dataclass(frozen=True, slots=True)
class RecursiveLeastSquares(RecursiveLaw):
    r"""Least squares that forgets old samples at a constant rate, O21 (11)-(13).

    .. math:: V(\theta) = \sum_{k \le t} \lambda^{t-k} (y_k - \varphi_k^T \theta)^2

    With ``forgetting=1`` it is the Kalman filter with R1 = 0 and R2 = 1.

    Parameters
    ----------
    forgetting : float
        lambda in (0, 1]; about ``1/(1 - lambda)`` samples are remembered.

    Raises
    ------
    ValueError
        `forgetting` is outside (0, 1].
    """

    forgetting: float = 1.0

    def __post_init__(self) -> None:
        positive("forgetting", self.forgetting, at_most=1.0)

    @property
    def R1(self) -> float:  # noqa: N802 - R1 keeps its letter
        """Return 0: forgetting takes the place of a drift."""
        return 0.0

    def weigh(self, q: V, e: V, n: int, arithmetic: Arithmetic[V]) -> tuple[V, V | float]:
        """Return ``lambda + q`` and ``1/lambda``."""
        return self.forgetting + q, 1.0 / self.forgetting  # O21 (12), (13)


@dataclass(frozen=True, slots=True)
class VariableForgetting(RecursiveLaw):
    r"""Least squares that forgets as fast as its innovations are surprising, O21 (14).

    As printed, (12) needs the lambda that (14) computes from the gain of (12). By default the gain
    is the one without forgetting, as Fortescue et al. (1981) have it:

    .. math:: \lambda = \max\bigl(\lambda_{min},\ 1 - e^2 / ((1 + q)\,\Sigma_0)\bigr)

    With ``joint`` the two equations are solved together; lambda is then the positive root of

    .. math:: \lambda^2 + \lambda\,(q - 1 + e^2/\Sigma_0) - q = 0

    Parameters
    ----------
    Sigma0 : float
        Noise variance times the number of samples to remember; greater than zero.
    forgetting_min : float
        Least lambda, in (0, 1].
    joint : bool
        Solve (12) and (14) together.

    Raises
    ------
    ValueError
        `Sigma0` is not positive, `forgetting_min` is outside (0, 1] or `joint` no bool.
    """

    Sigma0: float
    forgetting_min: float = 0.2
    joint: bool = False

    def __post_init__(self) -> None:
        positive("Sigma0", self.Sigma0)
        positive("forgetting_min", self.forgetting_min, at_most=1.0)
        truth("joint", self.joint)

    @property
    def R1(self) -> float:  # noqa: N802 - R1 keeps its letter
        """Return 0: forgetting takes the place of a drift."""
        return 0.0

    def weigh(self, q: V, e: V, n: int, arithmetic: Arithmetic[V]) -> tuple[V, V | float]:
        """Return ``1 + q`` (``lambda + q`` when joint) and ``1/lambda``."""
        surprise = e * e / self.Sigma0
        if not self.joint:
            S = 1.0 + q
            return S, 1.0 / arithmetic.maximum(self.forgetting_min, 1.0 - surprise / S)  # O21 (14)
        half = 0.5 * (1.0 - q - surprise)
        size = arithmetic.maximum(1.0 / LARGEST, abs(half) + (half * half + q) ** 0.5)
        # half + (half**2 + q)**0.5, of which nothing would be left where half is large and negative
        root = q / size + 2.0 * arithmetic.maximum(0.0, half)  # O21 (12) and (14) together
        forgetting = arithmetic.maximum(self.forgetting_min, root)
        return forgetting + q, 1.0 / forgetting
