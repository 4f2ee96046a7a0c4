"""The balance of heat: which set points can be held, and when they are reached.

`feasible.Feasibility` sees every sample, steers nothing, and raises the alarms
`setpoint.unreachable` and `plant.driven`. `heat_loss` is its filter and `heat_belief` what that
believes; `foretold` widens forecasts by how wrong earlier ones were, `left_alone` watches a plant
without power, and `sides` keeps two balances where a plant is both heated and cooled.
"""
