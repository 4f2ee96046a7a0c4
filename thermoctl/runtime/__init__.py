"""The loop, its clocks, boards that come and go, loops that lead one another.

`loop` walks one sample through the house. `wiring` says which boards a loop is connected to,
`connection` opens and reopens them, `clock` tells the time, `asked` carries requests to the loop
and answers back. `lead`, `cascade` and `stored_heat` are for a loop whose output is the set point
of another one.
"""
