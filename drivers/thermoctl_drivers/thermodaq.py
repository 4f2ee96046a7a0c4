"""The thermodaq board, LM335 in and heater out, as a `Board`.

One input, ``temperature``: the sum of a burst of conversions over whole mains periods. One output,
``heater``: a power fraction, which expires on the board itself. The protocol is in
`thermoctl_drivers.thermodaq_frames`; here are only order, deadlines and consequences.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import ClassVar, Final, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from thermoctl.errors import (
    BoardConfigError,
    DriverError,
    FaultError,
    LinkError,
    TransientError,
    WrongDevice,
)
from thermoctl.ports import Capabilities, Clock, Health, Identity, Link
from thermoctl.signals import RawSample
from thermoctl_drivers import thermodaq_frames as frames
from thermoctl_drivers.outputs import commanded
from thermoctl_drivers.thermodaq_exchange import LINK_ERRORS, Answer, Exchange, RefusedByBoard
from thermoctl_drivers.thermodaq_frames import Flag, FrameError, Refusal, Reply

INPUT: Final = "temperature"
OUTPUT: Final = "heater"

_READ_ATTEMPTS = 2
_WRITE_ATTEMPTS = 3
_OPEN_WAIT_S = 0.25
_CLOSE_S = 0.3
_BITS_PER_BYTE = 10  # with start and stop bit
_OUTPUT_MODES = {"burst": 0, "phase-angle": 1}
_STARTED_ANEW = Flag.RESET | Flag.UNCONFIGURED

Parsed = TypeVar("Parsed")


class ThermoDaqSettings(BaseModel):
    """Table ``[boards.NAME]`` with ``kind = "thermodaq"``."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["thermodaq"] = "thermodaq"
    port: str = Field(min_length=1, description="Serial device, such as /dev/ttyACM0.")
    baud: int = Field(115200, ge=1200, le=4_000_000, description="Speed of the line in bit/s.")
    unit: int | None = Field(
        None, ge=0, le=65534, description="Number stored in the board; another one is refused."
    )
    mains_hz: Literal[50, 60] = Field(50, description="Mains frequency in Hz.")
    average_periods: int = Field(
        10, ge=1, le=50, description="Mains periods averaged into one sample; 32 conversions each."
    )
    output_mode: Literal["burst", "phase-angle"] = Field(
        "burst", description="Whole mains cycles, or a firing angle behind each zero crossing."
    )
    power_max: float = Field(
        1.0, ge=0.0, le=1.0, allow_inf_nan=False, description="Cap the board itself enforces."
    )
    dead_man_s: float = Field(
        2.5,
        ge=0.2,
        le=10.0,
        allow_inf_nan=False,
        description="The board cuts the heater this long after the last command, in s.",
    )
    reply_timeout_s: float = Field(
        0.08, ge=0.01, le=1.0, allow_inf_nan=False, description="Longest wait for one reply in s."
    )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the channels that are read."""
        return (INPUT,)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the channels that may be written."""
        return (OUTPUT,)


class ThermoDaq:
    """thermodaq: LM335 in, heater out, dead-man; an Arduino Uno on a serial port.

    Parameters
    ----------
    settings : ThermoDaqSettings
        What the board is told when it is opened.
    link : Link
        An opened serial port, or anything that behaves like one.
    clock : Clock
        Where deadlines are measured.
    """

    Settings: ClassVar[type[ThermoDaqSettings]] = ThermoDaqSettings
    transport: ClassVar[str] = "serial"
    capabilities: Capabilities = Capabilities(dead_man=True, readback=True)

    def __init__(self, settings: ThermoDaqSettings, link: Link, clock: Clock) -> None:
        self._settings, self._link, self._clock = settings, link, clock
        self._exchange = Exchange(link, clock)
        self._counters: Counter[str] = Counter()
        self._state = "closed"  # then "open", "lost", and at last "gone"
        self._confirmed: int | None = None  # power the board took last; None: not known
        self._flags = Flag(0)
        self._last_error: str | None = None

    # -- the port --------------------------------------------------------------------------------

    def open(self, deadline_s: float) -> Identity:
        """Write power 0 first, then identify and configure the board.

        A board may start anew when its port is opened and stay in its boot loader for two seconds;
        it is asked again until `deadline_s`.

        Raises
        ------
        LinkError
            When nothing answers, or the link fails.
        WrongDevice
            When what answers is not this board.
        """
        with self._noted():
            if self._state == "gone":
                raise LinkError(f"expected an open port {self._settings.port}, it was let go")
            self._switch_off(deadline_s)
            try:
                identity = self._initialise(deadline_s)
            except TransientError as error:
                raise LinkError(f"{self._settings.port}: {error}") from error
            self._state = "open"
            return identity

    def read(self, deadline_s: float) -> Mapping[str, RawSample]:
        """Return the last burst of the converter; empty before the first one.

        A board that has started anew is initialised again, with power 0.

        Raises
        ------
        TransientError
            When two attempts brought no valid reply before `deadline_s`.
        FaultError
            When the power read back is not the one that was accepted.
        LinkError
            When the link is gone.
        """
        with self._noted():
            self._check_open()
            asked_s = self._clock.now_s()
            answer = self._ask("R", deadline_s=deadline_s, attempts=_READ_ATTEMPTS)
            reading = _parsed(frames.reading, answer.reply)
            if reading.flags & _STARTED_ANEW:
                self._begin_again(deadline_s)
            else:
                self._check_readback(reading)
        if reading.count == 0:
            return {}
        on_the_line_s = frames.length_of(answer.reply) * _BITS_PER_BYTE / self._settings.baud
        made_s = max(answer.received_s - on_the_line_s, asked_s)
        sample = RawSample(
            t_s=made_s - reading.age_ms / 1000.0,
            counts=float(reading.total),
            full_scale=float(reading.count * frames.COUNTS_PER_CONVERSION),
            sequence=reading.sequence,
        )
        return {INPUT: sample}

    def write(
        self, outputs: Mapping[str, float], valid_for_s: float, deadline_s: float
    ) -> Mapping[str, float]:
        """Set the heater for at most `valid_for_s` and return what the board took.

        A board that has started anew is initialised again and stays at power 0 this time.

        Raises
        ------
        TransientError
            When three attempts brought no valid reply before `deadline_s`.
        FaultError
            When the board refused three times, or took more than it was told; when the power or
            the time is infinite or no number, and the board has been told power 0 then.
        BoardConfigError
            When `outputs` names one that the board does not have.
        LinkError
            When the link is gone.
        """
        with self._noted():
            self._check_open()
            if unknown := sorted(set(outputs) - {OUTPUT}):
                raise BoardConfigError(f"the only output is {OUTPUT!r}, got {unknown}")
            if OUTPUT not in outputs:
                return {}
            try:
                wished, held_s = commanded(
                    OUTPUT, outputs[OUTPUT], valid_for_s, self._settings.dead_man_s
                )
            except FaultError:
                self._command(0, 1, deadline_s)
                raise
            valid_ms, power = int(held_s * 1000.0), round(wished * frames.FULL_POWER)
            taken = self._command(power if valid_ms > 0 else 0, max(valid_ms, 1), deadline_s)
            return {OUTPUT: taken / frames.FULL_POWER}

    def health(self) -> Health:
        """Return counters, the last error, and ``ok``, ``degraded`` or ``down``."""
        error = self._last_error
        phase_angle = self._settings.output_mode == "phase-angle"
        if error is None and phase_angle and Flag.SYNCHRONOUS not in self._flags:
            error = "expected zero crossings for the phase angle, got none: bursts instead"
        working = "ok" if error is None else "degraded"
        return Health(
            status=working if self._state == "open" else "down",
            counters=dict(self._exchange.counters + self._counters),
            last_good_s=self._exchange.last_good_s,
            last_error=error,
        )

    def close(self) -> None:
        """Write power 0, let the port go; idempotent, never raises."""
        if self._state == "gone":
            return
        if self._state == "open":
            with contextlib.suppress(DriverError):
                self._command(0, 1, self._clock.now_s() + _CLOSE_S)
        self._state = "gone"
        with contextlib.suppress(*LINK_ERRORS):
            self._link.close()

    # -- what the board is told ------------------------------------------------------------------

    def _switch_off(self, deadline_s: float) -> None:
        """Ask for power 0, before anything else, until something valid answers."""
        garbled = self._exchange.counters["garbled"]
        while True:
            self._exchange.forget()
            until_s = min(self._clock.now_s() + _OPEN_WAIT_S, deadline_s)
            try:
                self._exchange.ask("W", 0, 1, deadline_s=until_s, wait_s=_OPEN_WAIT_S, attempts=1)
                return
            except RefusedByBoard as error:
                raise WrongDevice(f"expected a board that takes power 0: {error}") from error
            except TransientError as error:
                self._clock.sleep_until(until_s)  # a babbling device must not make us hurry
                if self._clock.now_s() < deadline_s:
                    continue
                heard = self._exchange.counters["garbled"] > garbled
                lost = WrongDevice if heard else LinkError
                raise lost(f"expected a thermodaq on {self._settings.port}: {error}") from error

    def _initialise(self, deadline_s: float) -> Identity:
        """Ask who is there and send the configuration, which leaves the output at 0."""
        settings = self._settings
        answer = self._ask("H", deadline_s=deadline_s, attempts=_READ_ATTEMPTS)
        who = _parsed(frames.hello, answer.reply)
        if (who.product, who.protocol) != (frames.PRODUCT, frames.PROTOCOL):
            expected = f"{frames.PRODUCT} with protocol {frames.PROTOCOL}"
            raise WrongDevice(f"expected a {expected}, got {who.product} {who.protocol}")
        if settings.unit is not None and who.unit != settings.unit:
            raise WrongDevice(f"expected unit {settings.unit}, got {who.unit}")
        wanted = (
            _OUTPUT_MODES[settings.output_mode],
            settings.mains_hz,
            settings.average_periods,
            round(settings.dead_man_s * 1000.0),
            round(settings.power_max * frames.FULL_POWER),
        )
        answer = self._ask("C", *wanted, deadline_s=deadline_s, attempts=_READ_ATTEMPTS)
        if answer.reply.fields != tuple(str(value) for value in wanted):
            raise FaultError(f"expected configuration {wanted}, got {answer.reply.fields}")
        self._confirmed = 0
        return Identity(frames.PRODUCT, f"{settings.port} unit {who.unit}", who.version)

    def _begin_again(self, deadline_s: float) -> None:
        """Initialise a board that has started anew; its output is 0 until the next command."""
        self._counters["resets"] += 1
        self._confirmed = None
        self._initialise(deadline_s)

    def _command(self, power: int, valid_ms: int, deadline_s: float) -> int:
        """Send one output command and return what was taken, in 1/10000."""
        self._confirmed = None
        try:
            answer = self._ask(
                "W", power, valid_ms, deadline_s=deadline_s, attempts=_WRITE_ATTEMPTS
            )
        except RefusedByBoard as refused:
            if not refused.because(Refusal.UNCONFIGURED):
                raise
            self._begin_again(deadline_s)
            return 0
        done = _parsed(frames.written, answer.reply)
        if done.flags & _STARTED_ANEW:
            self._begin_again(deadline_s)
            return 0
        if done.power > power:
            raise FaultError(f"expected at most {power} of 10000, the board took {done.power}")
        self._flags, self._confirmed = done.flags, done.power
        return done.power

    def _check_readback(self, reading: frames.Reading) -> None:
        """Compare the power in force with the one accepted; count a cut by the dead-man once."""
        newly_cut = Flag.CUT in reading.flags and Flag.CUT not in self._flags
        self._flags = reading.flags
        self._counters["cuts"] += newly_cut
        if Flag.CUT in reading.flags or self._confirmed is None:
            return
        if reading.power != self._confirmed:
            self._counters["readback"] += 1
            raise FaultError(
                f"read-back: expected {self._confirmed} of 10000, the board gives {reading.power}"
            )

    # -- how it is asked -------------------------------------------------------------------------

    def _ask(self, letter: str, *arguments: int, deadline_s: float, attempts: int) -> Answer:
        """Return the answer within the reply time of the settings."""
        wait_s = self._settings.reply_timeout_s
        return self._exchange.ask(
            letter, *arguments, deadline_s=deadline_s, wait_s=wait_s, attempts=attempts
        )

    def _check_open(self) -> None:
        if self._state != "open":
            raise LinkError(f"expected an open board on {self._settings.port}, it is {self._state}")

    @contextlib.contextmanager
    def _noted(self) -> Iterator[None]:
        """Remember the last error for `health`; a success forgets it."""
        try:
            yield
        except LinkError as error:
            self._last_error = str(error)
            self._state = "gone" if self._state == "gone" else "lost"
            raise
        except DriverError as error:
            self._last_error = str(error)
            raise
        self._last_error = None


def _parsed(parse: Callable[[Reply], Parsed], reply: Reply) -> Parsed:
    """Return ``parse(reply)``; a valid line of another form is a passing error."""
    try:
        return parse(reply)
    except FrameError as error:
        raise TransientError(str(error)) from error
