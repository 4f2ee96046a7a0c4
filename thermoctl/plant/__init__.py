"""Simulated physics: a stirred tank with everything that makes control hard."""
