"""Simulated physics: a stirred tank with everything that makes control hard.

`tank` puts the parts of one together, made of `parameters` or, for a fleet, of these within
`tolerances`. `power_stage` turns a drive into watts, `thermal` these into temperatures, with the
books of energy in `ledger`; `coil` is its cooler, `probe` its sensor and `acquisition` the
converter behind that. `disturbances` are what can befall it by name, `handling` what people do to
the water, and `noise` is where randomness comes from. `lab` is another plant, the Temperature
Control Lab.
"""
