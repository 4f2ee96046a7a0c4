"""A bank of corrected Kalman filters and the coasting temperature.

The field would call this multiple-model adaptive control: filters run side by side, one for each
hypothesis of lag and shape, and are weighted by their likelihoods. Section 9 of ``docs/theory.md``
has the equations, and the glossary the words. In the order in which a sample meets the modules:

- `controller` is the law as a `Controller`; `constants` are its settings.
- `trial` runs a remembered bank beside one that knows nothing, and keeps the better; `remembered`
  is what is kept between runs, `held` the remembered bank of a plant that was held until just now.
- `bank` takes a sample through prediction and correction. `Bank.predict` is the time update and
  `Bank.correct` the measurement update; `bank_belief` is the state of both. At a start there are
  `twins`: met at rest, and met under full power.
- `hypotheses` are the lags and shapes, `path` is the power on its way through each of them.
- `filters` are the Kalman filters, all in one array; `gains` keeps their gains while the plant is
  at rest.
- `evidence` is noise, excitation, gate, drift and weights; `colour` is noise that is not white,
  `likelihood` how likely a reading is.
- `coasting` computes the temperature at which the plant would come to rest, and the power from it.
- `plant_belief` says what is believed in physical units.
"""

from thermoctl.control.adaptive.controller import Adaptive, AdaptiveBelief

__all__ = ["Adaptive", "AdaptiveBelief"]
