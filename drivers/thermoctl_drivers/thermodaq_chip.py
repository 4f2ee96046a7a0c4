"""The board's firmware on a simulated ATmega328P, through libsimavr.

Both are built by ``make all sim`` in drivers/firmware/thermodaq and are no part of the wheel; where
they cannot be built, `thermoctl_drivers.thermodaq_board` does the same without them.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

from thermoctl.errors import Unavailable

FREQUENCY_HZ = 16_000_000
FIRMWARE = Path(__file__).resolve().parents[1] / "firmware" / "thermodaq"

_BUILD_S = 120.0
_PROBES = {  # Debian package: what must be able to find the header it brings
    "gcc-avr avr-libc": ("avr-gcc", "-mmcu=atmega328p", "-include", "avr/io.h"),
    "gcc libelf-dev": ("cc", "-include", "libelf.h"),
    "libsimavr-dev": ("cc", "-isystem", "/usr/include/simavr", "-include", "sim_avr.h"),
}
_RECEIVE_SIZE = 4096


@cache
def missing() -> str | None:
    """Return what this machine lacks to simulate the chip, None for nothing."""
    if not (FIRMWARE / "Makefile").is_file():
        return f"expected the firmware's sources in {FIRMWARE}, they are not installed"
    if shutil.which("make") is None:
        return "expected make, it is not installed (Debian: make)"
    for package, probe in _PROBES.items():
        if shutil.which(probe[0]) is None:
            return f"expected {probe[0]}, it is not installed (Debian: {package})"
        command = [*probe, "-E", "-x", "c", os.devnull]
        if subprocess.run(command, capture_output=True, timeout=_BUILD_S, check=False).returncode:
            return f"expected {probe[-1]}, it is not installed (Debian: {package})"
    return None


@cache
def build() -> Path:
    """Build firmware and harness where out of date; return the directory.

    Raises
    ------
    Unavailable
        Naming what is missing, or what make says.
    """
    if why := missing():
        raise Unavailable(why)
    target = FIRMWARE / "build"
    try:
        target.mkdir(exist_ok=True)
        with (target / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # several processes build one after the other
            done = subprocess.run(
                ["make", "-C", str(FIRMWARE), "all", "sim"],
                capture_output=True,
                text=True,
                timeout=_BUILD_S,
                check=False,
            )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Unavailable(f"the firmware does not build: {error}") from error
    if done.returncode != 0:
        raise Unavailable(f"the firmware does not build: {done.stderr.strip()}")
    return target


@cache
def _library() -> ctypes.CDLL:
    """Load the harness and declare its functions."""
    try:
        library = ctypes.CDLL(str(build() / "libthermodaq_sim.so"))
    except OSError as error:
        raise Unavailable(f"the chip simulator does not load: {error}") from error
    handle, u64, u32 = ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint32
    signatures: dict[str, tuple[object, list[object]]] = {
        "new": (handle, [ctypes.c_char_p, u64]),
        "free": (None, [handle]),
        "run": (ctypes.c_int, [handle, u64]),
        "send": (u32, [handle, ctypes.c_char_p, u32]),
        "receive": (u32, [handle, ctypes.c_char_p, u32]),
        "analog": (None, [handle, *[ctypes.c_double] * 4]),
        "crossings": (None, [handle, u64]),
        "reset": (None, [handle]),
        "poke": (None, [handle, ctypes.c_uint16, ctypes.c_uint8]),
        "cycle": (u64, [handle]),
        "on_cycles": (u64, [handle]),
        "edges": (u64, [handle]),
        "off_since": (u64, [handle]),
        "level": (ctypes.c_int, [handle]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"thermodaq_sim_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class Chip:
    """An ATmega328P with our firmware; only `advance` moves it on.

    Parameters
    ----------
    seed : int
        Of the noise on the analog input.

    Raises
    ------
    Unavailable
        When compiler or simulator are missing.
    """

    def __init__(self, seed: int = 1) -> None:
        self._calls = _library()
        elf = build() / "thermodaq.elf"
        self._board: int | None = self._calls.thermodaq_sim_new(str(elf).encode(), seed)
        if self._board is None:
            raise Unavailable(f"expected simavr to load {elf}, it did not")

    @property
    def t_s(self) -> float:
        """Time since power-on in s, to a cycle."""
        return float(self._calls.thermodaq_sim_cycle(self._board)) / FREQUENCY_HZ

    @property
    def on_s(self) -> float:
        """How long the heater pin has been high, in all, in s."""
        return float(self._calls.thermodaq_sim_on_cycles(self._board)) / FREQUENCY_HZ

    @property
    def off_since_s(self) -> float:
        """When the heater pin went low the last time, in s."""
        return float(self._calls.thermodaq_sim_off_since(self._board)) / FREQUENCY_HZ

    @property
    def edges(self) -> int:
        """How often the heater pin has gone high."""
        return int(self._calls.thermodaq_sim_edges(self._board))

    @property
    def level(self) -> bool:
        """Whether the heater pin is high."""
        return bool(self._calls.thermodaq_sim_level(self._board))

    def analog(
        self,
        millivolts: float,
        noise_mv: float = 0.0,
        pickup_mv: float = 0.0,
        mains_hz: float = 50.0,
    ) -> None:
        """Put `millivolts` on the analog input, with noise and a sine of the mains."""
        self._calls.thermodaq_sim_analog(self._board, millivolts, noise_mv, pickup_mv, mains_hz)

    def crossings(self, mains_hz: float) -> None:
        """Put zero crossings of a mains of `mains_hz` on their input; 0 leaves it open."""
        half_wave = round(FREQUENCY_HZ / 2.0 / mains_hz) if mains_hz > 0.0 else 0
        self._calls.thermodaq_sim_crossings(self._board, half_wave)

    def reset(self) -> None:
        """Pull the reset pin."""
        self._calls.thermodaq_sim_reset(self._board)

    def poke(self, address: int, value: int) -> None:
        """Write a register behind the firmware's back."""
        self._calls.thermodaq_sim_poke(self._board, address, value)

    def send(self, data: bytes) -> None:
        """Put bytes on the line to the board; they arrive at 115200 baud."""
        self._calls.thermodaq_sim_send(self._board, data, len(data))

    def receive(self) -> bytes:
        """Return what the board has sent since the last call."""
        received = b""
        buffer = ctypes.create_string_buffer(_RECEIVE_SIZE)
        while count := self._calls.thermodaq_sim_receive(self._board, buffer, _RECEIVE_SIZE):
            received += buffer.raw[:count]
        return received

    def advance(self, seconds: float) -> None:
        """Let time pass; raise `RuntimeError` when the chip has crashed."""
        if self._calls.thermodaq_sim_run(self._board, max(round(seconds * FREQUENCY_HZ), 0)) != 0:
            raise RuntimeError(f"the simulated chip crashed at {self.t_s:.3f} s")

    def close(self) -> None:
        """Let the simulator go; idempotent."""
        board, self._board = self._board, None
        if board is not None:
            self._calls.thermodaq_sim_free(board)
