"""What the operator is told of a plant: words, changes, drifts, performance."""

from thermoctl.insight.values import Change, Drift, Gate, Insight, Limit, Performance, Row
from thermoctl.insight.watcher import Insights

__all__ = ["Change", "Drift", "Gate", "Insight", "Insights", "Limit", "Performance", "Row"]
