"""Controllers against each other: the same plants and mishaps, known bounds."""
