"""Drivers that come with thermoctl; each is found by its entry point.

`null` writes nowhere, `simulated` is wired to a simulated tank, and `thermodaq` is our own board:
`thermodaq_frames` are the bytes of its protocol, `thermodaq_exchange` one request with its reply.
`thermodaq_board` and `thermodaq_chip` are simulations of that board, in Python and with its own
firmware. `outputs` checks what may be asked of any of them.
"""
