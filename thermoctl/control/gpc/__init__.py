"""Generalized predictive control with a model that is learnt as it runs."""

from thermoctl.control.gpc.controller import GpcBelief, SelfTuningGpc

__all__ = ["GpcBelief", "SelfTuningGpc"]
