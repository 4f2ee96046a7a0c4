"""What is assumed of plant, sensor and actuator: structure, curves, laws."""
