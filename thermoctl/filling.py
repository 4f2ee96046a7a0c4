"""Constructors of frozen dataclasses, as fast as those of open ones.

The constructor that `dataclass` writes for a frozen class hands every field to
``object.__setattr__``, because the class itself refuses it: ten times the price of an assignment.
A sample fills some fifty fields; so they take 5 % less of its time (``docs/benchmarks.md``).
"""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any, TypeVar

T = TypeVar("T")


def quickly_filled(cls: type[T]) -> type[T]:
    """Return the frozen dataclass `cls`, whose constructor now assigns its fields.

    While it does, the instance is of a private subclass that is not frozen; what the constructor
    returns is of `cls`, and as frozen as before. It pays from some three fields on.

    Raises
    ------
    TypeError
        `cls` has a ``__post_init__``, a default factory or a field that is no argument.
    """
    told: tuple[Any, ...] = fields(cls)  # type: ignore[arg-type]
    plain = all(each.init and each.default_factory is MISSING for each in told)
    if not plain or hasattr(cls, "__post_init__"):
        raise TypeError(f"expected fields alone, without factories or checks, got {cls.__name__}")
    as_open = {"__setattr__": object.__setattr__, "__delattr__": object.__delattr__}
    room: dict[str, Any] = {
        "frozen": cls,
        "twin": type(cls.__name__, (cls,), {"__slots__": (), **as_open}),
        "put": object.__setattr__,
        "usual": cls.__init__,
    }
    names = [each.name for each in told]
    given = ", ".join(names)
    lines = [
        f"def __init__(self, {given}):",
        f"    if self.__class__ is not frozen: return usual(self, {given})",  # a class made of it
        "    put(self, '__class__', twin)",
        *(f"    self.{name} = {name}" for name in names),
        "    self.__class__ = frozen",
    ]
    exec("\n".join(lines), room)  # as `dataclass` does, and `namedtuple`
    quick, usual = room["__init__"], cls.__init__
    for kept in ("__defaults__", "__annotations__", "__qualname__", "__module__"):
        setattr(quick, kept, getattr(usual, kept))
    cls.__init__ = quick  # type: ignore[method-assign]
    return cls
