"""One measurement in, one step out: modes, limits, trips, alarms.

`regulator` is the walk of a sample through this room, and `plan` what a regulator is made of. In
the order in which a sample meets the others:

- `pairing` makes one measurement of two sensors.
- `wishes` keeps what the operator wants, `reference` where a ramp to the set point is, and `load` a
  loss that was announced.
- `supervisor` keeps the state and bounds the power. It goes by `limits`, judges readings with
  `judge`, lets heater and cooler take turns with `changeover`, takes outputs that give more than
  they were told for an account in `overdrawn`, and lists what is wrong in `alarms`.
- `learning` keeps the model that is learnt beside every controller, and with `holding` the power
  that holds the plant.
- `heater` checks that the reading answers to the power, `balance` which set points can be held.
- `steering` asks the controller in charge and `shadow` the one that only watches; `tally` is the
  score between them. Each is a `mind`, a law with its belief, and called under a `guard`, so that a
  law that raises costs power and not the loop.
- `recollection` is what outlives a restart of what all of them have learnt.
"""

from thermoctl.regulator.limits import Limits
from thermoctl.regulator.plan import Plan
from thermoctl.regulator.regulator import Regulator

__all__ = ["Limits", "Plan", "Regulator"]
