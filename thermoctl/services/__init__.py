"""Consumers of finished cycles: history, state, journal. They never steer."""
