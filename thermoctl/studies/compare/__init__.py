"""Controllers against each other: the same plants and mishaps, known bounds.

- What is compared: `baselines` are controllers from elsewhere and `marlin` a predictive one;
  `plants` are fleets drawn from seeds, `scenarios` what befalls them, `stand` is what a regulator
  is wired to.
- `run` plays every combination once, `play` is one of them, and `store` keeps results on disk.
- What nobody can beat: `bounds`, from `linear` (the tank) or `labs` (the lab) as a linear plant,
  the `riccati` equation for holding, and `swift` for the fastest way to a set point.
- `score` measures a run, `summary` makes figures of many, `goals` are those to be met; `present`
  and `figure` show them.
"""
