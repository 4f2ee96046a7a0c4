"""The power to ask for.

Laws: `adaptive`, the default; `gpc`, predictive control on a model that is learnt; and
`minimum_variance`, `pid`, `on_off`, `manual`. What several of them use:

- `prediction` iterates a model over its delay.
- `inexact` is the error of an output against its commands.
- `mirror` turns a plant that is cooled into one that is heated, and `cooling` weighs a cooler
  against the heater beside it.
- `lasting` keeps a condition that flickers from being news at every sample.
"""
