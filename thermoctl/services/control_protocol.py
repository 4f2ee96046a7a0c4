"""The words of the control socket: a JSON object a line, checked before use.

A call is ``{"v": 1, "id": 7, "do": "set", "loop": "tank", "value_c": 40.0}``; its reply repeats
``v`` and ``id`` and says ``"ok": true``, or ``"ok": false`` with an ``error``. Nothing here does
I/O. The page on it is docs/control.md.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NoReturn

from thermoctl.errors import ThermoctlError
from thermoctl.quantities import is_finite_number
from thermoctl.services.plain import as_json

VERSION: Final = 1
LONGEST: Final = 4096
"""Bytes of one line, its end included; the longest honest call has a tenth of that."""

_SHOWN: Final = 60
_LONGEST_TEXT: Final = 200

Identity = str | int | None
"""What a client may call its call by."""


@dataclass(frozen=True, slots=True)
class _Argument:
    """A key of a call that is its own: its name, its type, and whether it may be left out."""

    name: str
    number: bool = False
    flag: bool = False
    optional: bool = False


_ARGUMENTS: Final[Mapping[str, tuple[_Argument, ...]]] = {
    "status": (),
    "get": (_Argument("key"),),
    "set": (
        _Argument("value_c", number=True),
        _Argument("rate_k_per_min", number=True, optional=True),
    ),
    "mode": (_Argument("mode"),),
    "output": (_Argument("power", number=True),),
    "load": (_Argument("power", number=True), _Argument("duration_s", number=True)),
    "controller": (_Argument("name"),),
    "shadow": (_Argument("name"),),
    "alarms": (),
    "ack": (_Argument("code", optional=True),),
    "watch": (_Argument("details", flag=True, optional=True),),
}


class CallError(ThermoctlError):
    """A call is not carried out; `error` says why in keys a program can read.

    Parameters
    ----------
    code : str
        Stable name, listed in docs/control.md.
    expected, got : str, optional
        What should have come, and what came.
    text : str, optional
        A sentence instead of the two.
    """

    def __init__(
        self,
        code: str,
        expected: str | None = None,
        got: object = None,
        *,
        text: str | None = None,
    ) -> None:
        self.code = code
        self.call_id: Identity = None
        self.error = {"code": code}
        if expected is not None:
            self.error |= {"expected": expected, "got": _shown(got)}
        if text is not None:
            self.error["text"] = text
        super().__init__(error_words(self.error))


@dataclass(frozen=True, slots=True)
class Call:
    """One call: what to do, for which loop, with which argument, and which `also`."""

    do: str
    call_id: Identity = None
    loop: str | None = None
    argument: str | float | bool | None = None
    also: str | float | bool | None = None


def error_words(error: Mapping[str, Any]) -> str:
    """Return an error of a reply as one sentence."""
    if "expected" in error:
        return f"expected {error['expected']}, got {error.get('got')}"
    return str(error.get("text") or error.get("code"))


# -- from a client ---------------------------------------------------------------------------------


def parse(line: bytes) -> Call:
    """Return the call that `line` holds.

    Raises
    ------
    CallError
        It holds none; the error carries the id of the call where that could be read.
    """
    keys = _object(line)
    call_id = keys.get("id")
    if isinstance(call_id, bool) or not isinstance(call_id, str | int | None):
        raise CallError("bad_value", "an id that is a text or a whole number", call_id)
    if len(str(call_id)) > _LONGEST_TEXT:
        raise CallError("bad_value", f"an id of at most {_LONGEST_TEXT} characters", call_id)
    try:
        return _call(keys, call_id)
    except CallError as error:
        error.call_id = call_id
        raise


def _object(line: bytes) -> dict[str, Any]:
    try:
        text = line.decode()
    except UnicodeDecodeError as error:
        raise CallError("bad_utf8", "UTF-8", line[error.start : error.start + 8]) from error
    try:
        keys = json.loads(text, parse_constant=_no_number, object_pairs_hook=_unique)
    except (ValueError, RecursionError) as error:
        raise CallError("bad_json", f"one JSON object a line ({error})", text) from error
    if not isinstance(keys, dict):
        raise CallError("bad_json", "one JSON object a line", text)
    return keys


def _no_number(word: str) -> NoReturn:
    """Refuse what Python reads and JSON does not know."""
    raise ValueError(f"{word} is no number")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = dict(pairs)
    if len(keys) < len(pairs):
        raise ValueError("a key occurs twice")
    return keys


def _call(keys: Mapping[str, Any], call_id: Identity) -> Call:
    version, do, loop = keys.get("v"), keys.get("do"), keys.get("loop")
    if isinstance(version, bool) or version != VERSION:
        raise CallError("bad_version", f'"v": {VERSION}', version)
    if not isinstance(do, str) or do not in _ARGUMENTS:
        raise CallError("unknown_call", f'"do" to be one of {", ".join(_ARGUMENTS)}', do)
    arguments = _ARGUMENTS[do]
    known = ["v", "id", "do", "loop", *(each.name for each in arguments)]
    if unknown := sorted(keys.keys() - known):
        raise CallError("unknown_key", f"no keys but {', '.join(known)}", unknown[0])
    if loop is not None:
        loop = _text("loop", loop)
    return Call(do, call_id, loop, *(_value(each, keys) for each in arguments))


def _value(argument: _Argument, keys: Mapping[str, Any]) -> str | float | bool | None:
    value = keys.get(argument.name)
    if value is None and argument.optional:
        return None
    if value is None:
        raise CallError("missing_key", f'a "{argument.name}"', "none")
    if argument.flag:
        if not isinstance(value, bool):
            raise CallError("bad_value", f'"{argument.name}" to be true or false', value)
        return value
    if not argument.number:
        return _text(argument.name, value)
    if isinstance(value, bool) or not is_finite_number(value):
        raise CallError("bad_value", f'"{argument.name}" to be a finite number', value)
    return float(value)


def _text(name: str, value: object) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= _LONGEST_TEXT:
        expected = f'"{name}" to be a text of 1 to {_LONGEST_TEXT} characters'
        raise CallError("bad_value", expected, value)
    return value


def _shown(value: object) -> str:
    """Return what came, short enough to be repeated; a reply must not be longer than a call."""
    text = value if isinstance(value, str) else repr(value)
    text = text if text and text.isprintable() else repr(text)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


# -- to a client -----------------------------------------------------------------------------------


def granted(call_id: Identity, content: Mapping[str, Any]) -> bytes:
    """Return the reply to a call that was carried out."""
    return _line({"v": VERSION, "id": call_id, "ok": True, **content})


def denied(call_id: Identity, error: CallError) -> bytes:
    """Return the reply to a call that was not."""
    return _line({"v": VERSION, "id": call_id, "ok": False, "error": error.error})


def told(
    call_id: Identity, cycle: Mapping[str, Any], details: Mapping[str, Any] | None = None
) -> bytes:
    """Return the line a watching client gets for a finished cycle."""
    beside = {} if details is None else {"details": details}
    return _line({"v": VERSION, "id": call_id, "cycle": cycle, **beside})


def asking(call_id: Identity, do: str, keys: Mapping[str, Any]) -> bytes:
    """Return a call as its client sends it; keys that are None are left out."""
    given = {name: value for name, value in keys.items() if value is not None}
    return _line({"v": VERSION, "id": call_id, "do": do, **given})


def _line(keys: Mapping[str, Any]) -> bytes:
    return f"{as_json(keys)}\n".encode(errors="replace")
