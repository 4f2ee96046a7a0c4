"""Make docs/images/live-view.svg: the live view of a simulated hour, as it stands in a terminal.

Run as ``python docs/make_live_picture.py [OUTPUT]``. The run is the bench test's own: the aquarium
of O21 warms up, and after 35 minutes a litre of cold water is poured in. The tick time in it is
that of the machine it was made on.
"""

from __future__ import annotations

import sys
from datetime import datetime
from pathlib import Path

from thermoctl.app.compose import loop_for
from thermoctl.app.daemon.insight_watch import insights_for
from thermoctl.app.live import Facts, LiveModel, Look, render
from thermoctl.app.live.picture import svg
from thermoctl.app.sim import bench_settings
from thermoctl.ports import Simulated
from thermoctl.runtime.clock import SimulatedClock
from thermoctl.signals import Cycle, Event

OUTPUT = Path(__file__).parent / "images" / "live-view.svg"
TITLE = "thermoctl --sim: the live view in a terminal, 55 minutes into a simulated run"
SEED, DURATION_S, POUR_AT_S = 1, 3300, 2100


def simulated_run() -> LiveModel:
    """Return the view's model after the whole run."""
    settings = bench_settings(seed=SEED)
    name, table = settings.loop()
    low_c, high_c = table.setpoint_range_c
    zero = datetime(2026, 3, 1, 13, 38)
    model = LiveModel(Facts(name, table.period_s, low_c, high_c, zero, speed=60.0))
    clock, watch = SimulatedClock(), insights_for(settings.loops)[name]

    def take(cycle: Cycle) -> None:
        watch.after(cycle.step, cycle.accepted_power)
        model.feed(cycle, watch.now)

    loop = loop_for(settings, clock, take, beside=False)
    for number in range(int(DURATION_S / table.period_s) + 1):
        t_s = number * table.period_s
        clock.sleep_until(t_s)
        loop.cycle(t_s)
        if t_s == POUR_AT_S:
            for connection in loop.boards:
                board: object = connection.board
                if isinstance(board, Simulated):
                    what = board.disturb("cold-water")
                    model.note(Event(t_s, "sim.disturbed", {"text": what}))
    loop.shut_down()
    return model


def main(output: Path) -> None:
    """Write the picture."""
    look = Look()
    rows = render(simulated_run().view(DURATION_S + 0.4), 100, 30, look)
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(svg(rows, look, TITLE), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else OUTPUT)
