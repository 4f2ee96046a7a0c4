"""The cooler: heat out of the water, behind a lag.

What cold its own mass holds is not booked anywhere: the coil is a lag on a flow of heat, so the
books of the tank stay exact. Near the freezing point it ices over, and takes less.
"""

from __future__ import annotations

import math

from thermoctl.plant.parameters import Cooler
from thermoctl.quantities import clamp

ICING_C = 2.0
"""Below this the coil takes ever less, and nothing at 0 degC: the model has no ice on coils."""


class CoolingCoil:
    """A cooler that follows its drive with a first-order lag.

    Parameters
    ----------
    parameters : Cooler
        Rated heat and lag.
    """

    def __init__(self, parameters: Cooler) -> None:
        self._parameters = parameters
        self._flow_w = 0.0

    def advance(self, step_s: float, drive: float, water_c: float) -> float:
        """Return the mean heat in W that leaves the water during the next `step_s`.

        Parameters
        ----------
        step_s : float
            Time to pass.
        drive : float
            Drive in [0, 1]; what lies outside is limited, and NaN is 0.
        water_c : float
            Temperature of the water around the coil.
        """
        rated_w, lag_s = self._parameters.rated_w, self._parameters.lag_s
        wanted_w = rated_w * clamp(drive, 0.0, 1.0)
        left = math.exp(-step_s / lag_s)
        ahead_w = self._flow_w - wanted_w
        self._flow_w = wanted_w + ahead_w * left
        mean_w = wanted_w + ahead_w * (1.0 - left) * lag_s / step_s
        return mean_w * clamp(water_c / ICING_C, 0.0, 1.0)
