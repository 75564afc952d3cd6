"""The proxy's messages, byte by byte."""

import socket
import threading

import pytest

import planner.centring.robot_link as kukavarproxy
from planner.centring.robot_link import VarProxy
from planner.centring.stop import LinkError
from tests.centring.test_session import angles, rows_of


@pytest.fixture
def line():
    """A proxy's client, and the other end of its connection, which gives prepared answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        proxy = VarProxy("127.0.0.1", server.getsockname()[1], 0.5)
        other, _ = server.accept()
        with other:
            yield proxy, other
        proxy.close()


def exchanged(line, answer, call):
    """Bytes that a call sends, and what it returns for these bytes as answer."""
    proxy, other = line
    sent = []
    thread = threading.Thread(target=lambda: (sent.append(other.recv(4096)), other.sendall(answer)))
    thread.start()
    try:
        return sent, call(proxy)
    finally:
        thread.join()


@pytest.mark.parametrize("length", [9, 6])
def test_read(line, length):
    answer = bytes([0, 1, 0, length, 0, 0, 3]) + b"100" + bytes([0, 1, 1])
    sent, value = exchanged(line, answer, lambda proxy: proxy.read("$OV_PRO"))
    # the message that clients of the proxy document for $OV_PRO
    assert sent == [bytes([0x00, 0x01, 0x00, 0x0A, 0x00, 0x00, 0x07, 0x24, 0x4F, 0x56, 0x5F, 0x50, 0x52, 0x4F])]
    assert value == "100"


def test_write(line):
    answer = bytes([0, 1, 0, 8, 1, 0, 2]) + b"50" + bytes([0, 1, 1])
    sent, _ = exchanged(line, answer, lambda proxy: proxy.write("$OV_PRO", "50"))
    assert sent == [bytes([0, 1, 0, 14, 1, 0, 7]) + b"$OV_PRO" + bytes([0, 2]) + b"50"]


def test_a_late_answer_is_passed_over(line):
    late = bytes([0, 9, 0, 8, 0, 0, 2]) + b"17" + bytes([0, 1, 1])
    answer = bytes([0, 1, 0, 7, 0, 0, 1]) + b"5" + bytes([0, 1, 1])
    assert exchanged(line, late + answer, lambda proxy: proxy.read("EDBB_GO"))[1] == "5"


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (bytes([0, 1, 0, 6, 0, 0, 0, 0, 1, 1]), "does not give 'EDBB_GO'"),  # no such variable
        (bytes([0, 1, 0, 6, 0, 0, 0, 0, 1, 0]), "does not give 'EDBB_GO'"),
        (bytes([0, 1, 0, 7, 1, 0, 1]) + b"5" + bytes([0, 1, 1]), "answered with mode 1"),
        (bytes([0, 1, 0, 7, 0, 0]), "gave no answer for 'EDBB_GO'"),
    ],
)
def test_answers_that_help_nobody(line, answer, says):
    with pytest.raises(LinkError, match=says):
        exchanged(line, answer, lambda proxy: proxy.read("EDBB_GO"))


def test_a_write_that_is_refused(line):
    with pytest.raises(LinkError, match="does not set 'EDBB_GO'"):
        exchanged(
            line, bytes([0, 1, 0, 7, 1, 0, 1]) + b"5" + bytes([0, 1, 0]), lambda proxy: proxy.write("EDBB_GO", "5")
        )


def test_a_session_outlives_the_servers_patience(cell, monkeypatch):
    monkeypatch.setattr(kukavarproxy, "IDLE_TIME", 0.0)  # as if every exchange came after a long time of reading
    made = cell(count=1, faults={"short": True})
    made.run()
    assert len(made.controller.connections) > 20
    assert made.world.miss(angles(rows_of(made.output))[0]) < 0.0055
