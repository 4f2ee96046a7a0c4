"""A bank of corrected Kalman filters and the coasting temperature."""

from thermoctl.control.adaptive.controller import Adaptive, AdaptiveBelief
from thermoctl.control.adaptive.plant_belief import PlantBelief

__all__ = ["Adaptive", "AdaptiveBelief", "PlantBelief"]
