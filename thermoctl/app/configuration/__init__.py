"""Configuration files: what they may hold, how they are read, begun and refused."""
