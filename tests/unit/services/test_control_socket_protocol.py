"""The words of the control socket: what is understood, and what is refused by which name."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermoctl.services.control_protocol import (
    LONGEST,
    Call,
    CallError,
    asking,
    denied,
    error_words,
    granted,
    parse,
    told,
)


def call(**keys):
    return json.dumps({"v": 1, "id": 7, **keys}).encode()


def test_a_call_is_read_with_its_id_its_loop_and_its_argument():
    assert parse(call(do="set", loop="tank", value_c=40)) == Call("set", 7, "tank", 40.0)
    assert parse(call(do="ack")) == Call("ack", 7)
    assert parse(b'{"v":1,"do":"status"}') == Call("status")


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (b"\xff\xfe", "bad_utf8"),
        (b"", "bad_json"),
        (b"hello", "bad_json"),
        (b"[1]", "bad_json"),
        (b"[" * (LONGEST - 1), "bad_json"),
        (b'{"v":1,"do":"set","value_c":NaN}', "bad_json"),
        (b'{"v":1,"do":"set","value_c":-Infinity}', "bad_json"),
        (b'{"v":1,"v":1,"do":"status"}', "bad_json"),
        (b'{"do":"status"}', "bad_version"),
        (b'{"v":2,"do":"status"}', "bad_version"),
        (b'{"v":true,"do":"status"}', "bad_version"),
        (b'{"v":1}', "unknown_call"),
        (b'{"v":1,"do":"explode"}', "unknown_call"),
        (b'{"v":1,"do":["set"]}', "unknown_call"),
        (call(do="set", value_c=40.0, ramp=2.0), "unknown_key"),
        (call(do="status", key="power"), "unknown_key"),
        (call(do="set"), "missing_key"),
        (call(do="get", key=None), "missing_key"),
        (call(do="set", value_c="40"), "bad_value"),
        (call(do="set", value_c=True), "bad_value"),
        (b'{"v":1,"do":"set","value_c":1e400}', "bad_value"),
        (b'{"v":1,"do":"set","value_c":' + b"9" * 400 + b"}", "bad_value"),
        (call(do="mode", mode=1), "bad_value"),
        (call(do="mode", mode=""), "bad_value"),
        (call(do="status", loop=3), "bad_value"),
        (call(do="status", loop="x" * 201), "bad_value"),
        (call(do="status", id="x" * 201), "bad_value"),
        (call(do="status", id=10**201), "bad_value"),
        (b'{"v":1,"id":[],"do":"status"}', "bad_value"),
        (b'{"v":1,"id":true,"do":"status"}', "bad_value"),
    ],
)
def test_what_is_no_call_is_refused_by_name(line, code):
    with pytest.raises(CallError) as refused:
        parse(line)
    assert refused.value.code == code
    assert {"expected", "got"} < refused.value.error.keys()


def test_an_empty_word_is_shown_as_one():
    with pytest.raises(CallError) as refused:
        parse(call(do="mode", mode=""))
    assert error_words(refused.value.error).endswith("got ''")


KEYS = st.sampled_from(["v", "id", "do", "loop", "key"]) | st.text(max_size=5)
VALUES = st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=9)
TREES = st.recursive(VALUES, lambda inner: st.dictionaries(KEYS, inner, max_size=5))


@given(st.binary(max_size=200) | TREES.map(lambda tree: json.dumps(tree).encode()))
def test_nothing_at_all_raises_anything_but_a_named_error(line):
    try:
        parse(line)
    except CallError as error:
        reply = denied(error.call_id, error)
    else:
        return
    assert json.loads(reply)["ok"] is False
    assert len(reply) < LONGEST


def test_an_error_carries_the_id_of_its_call():
    with pytest.raises(CallError) as refused:
        parse(call(do="explode"))
    assert json.loads(denied(refused.value.call_id, refused.value))["id"] == 7


def test_an_error_repeats_no_more_than_a_little_of_what_came():
    with pytest.raises(CallError) as refused:
        parse(call(do="get", key="x" * 3000))
    assert len(denied(7, refused.value)) < 300


def test_lines_say_version_and_id_and_hold_no_nan():
    assert json.loads(granted("a", {"x": float("nan")})) == {
        "v": 1,
        "id": "a",
        "ok": True,
        "x": None,
    }
    assert json.loads(told(1, {"power": 0.5})) == {"v": 1, "id": 1, "cycle": {"power": 0.5}}
    assert json.loads(told(1, {"power": 0.5}, {"theta": [1.0]}))["details"] == {"theta": [1.0]}
    assert parse(asking(3, "get", {"key": "power", "loop": None}).rstrip()) == Call(
        "get", 3, None, "power"
    )


def test_details_are_asked_for_by_true_and_by_nothing_else():
    assert parse(call(do="watch", details=True)).argument is True
    assert parse(call(do="watch")).argument is None
    for wrong in (1, "yes", [True]):
        with pytest.raises(CallError) as refused:
            parse(call(do="watch", details=wrong))
        assert refused.value.code == "bad_value"
