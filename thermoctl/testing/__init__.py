"""What a test needs: time, boards and lines under control.

`ManualClock` moves when it is told to. `ScriptedBoard` is a board that follows a script.
`Transcript` is a line that expects certain bytes and answers with others; `LockStepLink` joins a
driver to a simulated device, and `FaultyLink` breaks any line in the ways lines break.
`DriverContract` is what every driver is held to: subclass it in a test, and give it a `Rig`.

Nothing here needs pytest before a contract runs.
"""

from thermoctl.testing.boards import ScriptedBoard, Write
from thermoctl.testing.clock import ManualClock
from thermoctl.testing.contract import DriverContract, Rig
from thermoctl.testing.lines import Device, FaultyLink, LockStepLink, Transcript, Turn

__all__ = [
    "Device",
    "DriverContract",
    "FaultyLink",
    "LockStepLink",
    "ManualClock",
    "Rig",
    "ScriptedBoard",
    "Transcript",
    "Turn",
    "Write",
]
