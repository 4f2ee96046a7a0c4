"""Commissioning: the run, the trial of a signal, and what is reported."""
