"""What is assumed about the plant, its sensor and its actuator: structure, curves, laws."""
