"""PID control whose gains a warm-up or a relay can find."""

from thermoctl.control.pid.controller import Pid, PidBelief

__all__ = ["Pid", "PidBelief"]
