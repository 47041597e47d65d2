"""The two ends of a bench in step, without a bench: who waits for whom, and what becomes of either when one is gone."""

import socket
import sys

import pytest

from rig.errors import DeviceFault
from sim_backend.emulators.in_step.clock import InStepClock
from sim_backend.emulators.in_step.messages import LONGEST_STEP_S, START_S, Channel, Reply, Sent
from sim_backend.emulators.in_step.port import SteppedSocket

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="local sockets")


class Line:
    """A port that keeps what it was told."""

    name, written_bytes = "unix:here", 0

    def __init__(self):
        self.told = []

    def stamp(self, arrivals, vanished, patience_s):
        self.told.append((arrivals, vanished))


@pytest.fixture
def ends():
    ours, theirs = socket.socketpair()
    clock = InStepClock(Channel(ours), patience_s=0.05)
    other = Channel(theirs)
    yield clock, other
    clock.close()
    other.close()


def answer(other, number, now_s, sent=None):
    other.send(Reply(number, now_s, sent or {}))


def test_a_wait_is_asked_for_in_steps_and_ends_at_the_very_deadline(ends):
    clock, other = ends
    deadline_s = START_S + 2.5 * LONGEST_STEP_S
    for number, until_s in ((1, START_S + LONGEST_STEP_S), (2, START_S + 2 * LONGEST_STEP_S), (3, deadline_s)):
        answer(other, number, until_s)
    assert clock.wait_until(deadline_s) == deadline_s
    assert [other.request(1.0).until_s for _ in range(3)] == [
        START_S + LONGEST_STEP_S, START_S + 2 * LONGEST_STEP_S, deadline_s,
    ]  # fmt: skip
    assert clock.wait_until(START_S) == deadline_s, "a deadline that has passed asks for nothing"


def test_each_request_says_what_was_written_since_which_opening(ends):
    clock, other = ends
    line = Line()
    clock.join(line)
    line.written_bytes = 7
    answer(other, 1, START_S + 1e-3)
    clock.pause(1e-3)
    assert other.request(1.0).written == {"unix:here": (1, 7)}
    clock.join(Line())
    answer(other, 2, START_S + 2e-3)
    clock.pause(1e-3)
    assert other.request(1.0).written == {"unix:here": (2, 0)}


def test_what_an_earlier_opening_was_sent_is_nothing_to_the_next_one(ends):
    clock, other = ends
    line = Line()
    clock.join(Line())
    clock.join(line)
    answer(other, 1, START_S + 1e-3, {"unix:here": Sent(1, True, [(START_S, 3)])})
    clock.pause(1e-3)
    assert line.told == []
    answer(other, 2, START_S + 2e-3, {"unix:here": Sent(2, False, [(START_S, 3)])})
    clock.pause(1e-3)
    assert line.told == [([[START_S, 3]], True)]


def test_an_answer_that_ctrl_c_left_over_stamps_its_bytes_and_is_not_taken_for_the_next(ends):
    clock, other = ends
    line = Line()
    clock.join(line)
    clock._asked = 1  # the question was asked, and its answer never waited for
    answer(other, 1, START_S + 1e-3, {"unix:here": Sent(1, True, [(START_S, 3)])})
    answer(other, 2, START_S + 2e-3, {"unix:here": Sent(1, True, [(START_S + 2e-3, 5)])})
    assert clock.wait_until(START_S + 2e-3) == START_S + 2e-3
    assert [arrivals for arrivals, _ in line.told] == [[[START_S, 3]], [[START_S + 2e-3, 5]]]


@pytest.mark.parametrize("way", ["gone", "silent"])
def test_emulators_that_are_gone_or_silent_are_a_fault_at_once_and_ever_after(ends, way):
    clock, other = ends
    if way == "gone":
        other.close()
    for _ in range(2):
        with pytest.raises(DeviceFault, match="have ended" if way == "gone" else "have not answered for 0.05 s"):
            clock.pause(1e-3)
    assert clock.now_s() == START_S


def test_a_stepped_port_hands_over_once_a_step_and_says_when_it_sent_what():
    now = [5.0]
    port = SteppedSocket(lambda: now[0])
    port.write(b"nobody listens")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as peer:
        peer.connect(port.path.removeprefix("unix:"))
        peer.setblocking(False)
        port.read()
        for now[0], data in ((5.1, b"ab"), (5.2, b"c")):
            port.write(data)
        with pytest.raises(BlockingIOError):
            peer.recv(10)
        assert port.hand_over() == Sent(1, True, [(5.1, 2), (5.2, 3)])
        assert peer.recv(10) == b"abc"
        peer.send(b"four")
        port.read()
        assert port.received_bytes == 4
        port.write(b"z")
        port.close()
        assert peer.recv(10) == b"z"
        assert peer.recv(10) == b""
    assert port.hand_over() == Sent(1, False, [(5.2, 4)])
    assert port.lost_bytes == len(b"nobody listens")
