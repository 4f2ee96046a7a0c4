"""Drivers that come with thermoctl; each is found by its entry point."""
