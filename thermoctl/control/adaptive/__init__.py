"""A bank of corrected Kalman filters and the coasting temperature."""

from thermoctl.control.adaptive.controller import Adaptive, AdaptiveBelief

__all__ = ["Adaptive", "AdaptiveBelief"]
