"""What is assumed of plant, sensor and actuator: structure, curves, laws.

`arx` says what regresses on what, `sensor` turns counts into degrees and back, `actuator` power
into the drive of an output and back.
"""
