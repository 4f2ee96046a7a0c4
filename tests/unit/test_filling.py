"""Frozen values whose constructor assigns their fields."""

from __future__ import annotations

import copy
import inspect
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace

import pytest

from thermoctl.filling import quickly_filled
from thermoctl.ports import Situation
from thermoctl.signals import Beliefs, Measurement, RawSample, Step

QUICK = [Beliefs, Measurement, RawSample, Situation, Step]


@dataclass(frozen=True, slots=True)
class Usual:
    """As `dataclass` makes it."""

    power: float
    reason: str = "control"


@quickly_filled
@dataclass(frozen=True, slots=True)
class Quick:
    """The same, quickly filled."""

    power: float
    reason: str = "control"


class Loud(Quick):
    """A class made of a quick one."""


@pytest.mark.parametrize("kind", QUICK)
def test_every_field_of_a_quick_value_holds_what_was_given_for_it(kind):
    names = [each.name for each in fields(kind)]
    value = kind(*names)
    assert type(value) is kind
    assert [getattr(value, name) for name in names] == names


@pytest.mark.parametrize("kind", QUICK)
@pytest.mark.parametrize(
    "remade", [copy.copy, copy.deepcopy, replace, lambda value: pickle.loads(pickle.dumps(value))]
)
def test_a_quick_value_is_frozen_however_it_was_made(kind, remade):
    names = [each.name for each in fields(kind)]
    for value in (kind(*names), remade(kind(*names))):
        assert type(value) is kind
        with pytest.raises(FrozenInstanceError):
            setattr(value, names[0], None)
        with pytest.raises(FrozenInstanceError):
            delattr(value, names[0])


def test_a_quick_constructor_takes_what_the_usual_one_takes():
    assert inspect.signature(Quick) == inspect.signature(Usual)
    for given, named in (((0.5,), {}), ((0.5, "off"), {}), ((), {"reason": "off", "power": 0.5})):
        quick, usual = Quick(*given, **named), Usual(*given, **named)
        assert (quick.power, quick.reason) == (usual.power, usual.reason)
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'power'"):
        Quick()


def test_quick_values_are_equal_and_shown_as_usual_ones_are():
    assert Quick(0.5) == Quick(0.5, "control") != Quick(0.25)
    assert hash(Quick(0.5)) == hash(Quick(0.5))
    assert repr(Quick(0.5)) == repr(Usual(0.5)).replace("Usual", "Quick")


def test_a_class_made_of_a_quick_one_keeps_its_instances():
    loud = Loud(0.5, reason="off")
    assert type(loud) is Loud
    assert (loud.power, loud.reason) == (0.5, "off")


def test_a_class_with_more_to_do_at_its_start_is_refused():
    @dataclass(frozen=True, slots=True)
    class Checked:
        power: float

        def __post_init__(self) -> None:
            """Check nothing."""

    @dataclass(frozen=True, slots=True)
    class Made:
        power: list[float] = field(default_factory=list)

    for kind in (Checked, Made):
        with pytest.raises(TypeError, match=f"without factories or checks, got {kind.__name__}"):
            quickly_filled(kind)
