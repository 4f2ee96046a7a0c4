"""Consumers of finished cycles: history, state on disk, journal. They never steer."""
