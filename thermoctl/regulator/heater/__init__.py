"""Whether the reading answers to the heater.

`watch.HeaterWatch` sees every sample and asks when in doubt: it cuts the power and looks at what
the reading does. `check` has its settings; `led` watches a block that another loop heats, and
`sides` a heater with a cooler beside it. In the order in which a sample meets them:

- `stuck_sensor` tells a converter that repeats itself, `blocks` gathers samples over four seconds.
- `response` learns gain and lag of the heater by regression, `past` what was before a start, and
  `known` keeps what may be relied on.
- `doubt` holds readings against that model, `climb` against the last rise, `ceiling` knows the
  temperature that a plant does not pass, `silence` adds up heat that nothing follows, `standing`
  looks at readings that full power has not raised for long, and `unbroken` at full power that was
  never less. `trial` gives an unknown heater its time to show a rise, and `account` holds all its
  heat against what came of it.
- `rising` tells which rises without power prove that it is stuck on.
- `cut` is a question that is being put, `question` the regression that reads the answer, `evidence`
  weighs loads against faults, `balance` knows what a plant loses under one, `fall` a fall that no
  heater makes, and `hearing` says when an answer is believed. What a bad one leads to is in
  `verdicts`.
- `memory` keeps what is known between runs.
"""
