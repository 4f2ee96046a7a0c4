"""One measurement in, one step out: modes, limits, trips, alarms."""
