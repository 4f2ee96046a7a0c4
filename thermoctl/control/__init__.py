"""The power to ask for."""
