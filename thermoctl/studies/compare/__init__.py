"""Controllers against each other: the same plants, the same mishaps, known bounds."""
