"""The balance of heat: which set points can be held, and when they are reached.

`feasible.Feasibility` sees every sample and steers nothing. `heat_loss` is its filter and
`heat_belief` what that believes. Forecasts are for what is `wanted`; `foretold` widens them by how
wrong earlier ones were. `reach_alarms` raises `setpoint.unreachable` and `plant.driven`, and
`left_alone` watches a plant without power for it. `sides` keeps two balances where a plant is both
heated and cooled.
"""
