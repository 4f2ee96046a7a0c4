"""PID control whose gains a warm-up or a relay can find.

`controller` is the law and `terms` are its three parts. `autotune` bounds a test in time: `relay`
makes the plant swing, `step_test` takes the warm-up for a step, `step_fit` fits a plant to it, and
`stretch` is what a test looks at. `simc` has the rules that make gains of the result, and
`remembered` what is kept between runs.
"""

from thermoctl.control.pid.controller import Pid, PidBelief

__all__ = ["Pid", "PidBelief"]
