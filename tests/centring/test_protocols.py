"""What indicators say, byte by byte, as their manuals print it."""

import os
import time

import pytest

from planner.centring.indicators import open_indicators
from planner.centring.settings import HeadSettings, RefusedReadingError, find_protocol
from planner.centring.stop import StopRequest
from planner.common.errors import InputError
from tests.centring.devices import Terminal


@pytest.mark.parametrize(
    ("answer", "millimetres"),
    [
        (b"+00.0012", 0.0012),
        (b"-06.1500", -6.15),
        (b" 12.500", 12.5),
        (b"+0.003\n", 0.003),
        (b"\n-0.003", -0.003),
        (b"+00.00\x0012", None),
        (b"00.", None),
        (b"", None),
        (b"+000012", None),
        (b"+00.0012+00.0012", None),
        (b"NOR", None),
    ],
)
def test_sylvac(answer, millimetres):
    value = find_protocol("sylvac").value(answer, 1)
    assert value == (None if millimetres is None else pytest.approx(millimetres * 1e-3, abs=1e-12))
    assert find_protocol("sylvac").request(1) == b"?\r"


def test_sylvac_says_what_is_wrong():
    with pytest.raises(RefusedReadingError, match="out of its measuring range"):
        find_protocol("sylvac").value(b"ERR3", 1)


@pytest.mark.parametrize(
    ("answer", "channel", "millimetres"),
    [
        (b"01A+0000.123", 1, 0.123),  # the manual's own example
        (b"01A-0006.150", 1, -6.15),
        (b"03A+00.12345", 3, 0.12345),
        (b"02A+0000.123", 1, None),  # another channel's
        (b"01A+000.123", 1, None),  # a byte is lost
        (b"01A+00001234", 1, None),
    ],
)
def test_mitutoyo(answer, channel, millimetres):
    value = find_protocol("mitutoyo").value(answer, channel)
    assert value == (None if millimetres is None else pytest.approx(millimetres * 1e-3, abs=1e-12))
    assert find_protocol("mitutoyo").request(channel) == b"%d\r" % channel


def test_mitutoyo_without_an_indicator():
    with pytest.raises(RefusedReadingError, match="error 911"):
        find_protocol("mitutoyo").value(b"911", 1)


def test_an_unknown_protocol_names_the_nearest():
    with pytest.raises(InputError, match="no indicator protocol 'silvac'; did you mean \"sylvac\""):
        find_protocol("silvac")


@pytest.mark.parametrize(
    ("ports", "says"),
    [
        (["/dev/null", "/dev/zero"], "names 2 ports"),
        (["/dev/null"], "sylvac indicators have no channels"),
        (["a", "b", "a"], "names a port twice"),
        (["/dev/nothing1", "/dev/nothing2", "/dev/nothing3"], "/dev/nothing1 cannot be opened"),
    ],
)
def test_ports_that_cannot_be(ports, says):
    with pytest.raises(InputError, match=says):
        open_indicators(ports, find_protocol("sylvac"), HeadSettings(), StopRequest())


def test_what_was_sent_unasked_is_not_taken_for_the_answer():
    terminals = [Terminal(lambda request: b"+00.0100\r") for _ in range(3)]
    head = open_indicators([t.port for t in terminals], find_protocol("sylvac"), HeadSettings(), StopRequest())
    try:
        for terminal in terminals:
            os.write(terminal.master, b"+03.0000\r+0")  # somebody pressed its button, and began to again
        time.sleep(0.05)
        assert head.read() == pytest.approx([1e-5] * 3, abs=1e-12)
    finally:
        head.close()
        for terminal in terminals:
            terminal.close()
