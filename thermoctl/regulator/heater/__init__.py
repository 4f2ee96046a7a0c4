"""Whether the reading answers to the heater.

`watch.HeaterWatch` sees every sample and asks when in doubt. What it leans on: `response` learns
what heat does, `known` whether that will do, `doubt` and `climb` hold readings against it, `trial`
gives an unknown heater its time, `question` reads the answer and `hearing` believes it or not,
`ceiling` tells a plant that gets no warmer, `memory` keeps what is known between runs.
"""
