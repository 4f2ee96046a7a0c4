"""Generalized predictive control with a model that is learnt as it runs.

`controller` is the law. `record` keeps readings and powers in blocks, `model` is the ARX model of
their changes, and `learning` its Kalman filter. `moves` are the powers of least cost within their
bounds, `beyond` is the cost after the horizon, and `doubt` asks whether power warms at all.
"""

from thermoctl.control.gpc.controller import GpcBelief, SelfTuningGpc

__all__ = ["GpcBelief", "SelfTuningGpc"]
