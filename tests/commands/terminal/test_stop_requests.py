"""The first signal asks, a second Ctrl-C cuts."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator

import pytest

from commands.terminal.stop_requests import STOPPING, StopRequests
from rig.errors import Aborted

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a process cannot signal itself gently there")


def raise_signal(number: int) -> None:
    os.kill(os.getpid(), number)


@pytest.fixture
def stops() -> Iterator[StopRequests]:
    requests = StopRequests()
    with requests.handling_signals():
        yield requests


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_while_ticks_run_the_first_signal_becomes_the_reason_that_the_next_tick_reads(
    stops: StopRequests, name: str
) -> None:
    told: list[str] = []
    stops.show = told.append
    with stops.playing(lambda: None):
        assert stops.poll() is None
        raise_signal(getattr(signal, name))
        assert "Stopped by" in str(stops.poll())
    assert told == [STOPPING]


def test_a_second_ctrl_c_takes_the_torque_off_at_once(stops: StopRequests) -> None:
    cut: list[str] = []
    with stops.playing(lambda: cut.append("torque off")):
        stops.poll()
        raise_signal(signal.SIGINT)
        assert cut == []
        with pytest.raises(KeyboardInterrupt):
            raise_signal(signal.SIGINT)
    assert cut == ["torque off"]


def test_a_second_sigterm_is_no_second_ctrl_c(stops: StopRequests) -> None:
    with stops.playing(lambda: pytest.fail("torque was cut out of turn")):
        stops.poll()
        raise_signal(signal.SIGTERM)
        raise_signal(signal.SIGHUP)
        assert stops.poll() == "Stopped by SIGTERM"


def test_before_the_first_tick_a_signal_raises_so_that_nothing_is_armed_any_more(stops: StopRequests) -> None:
    with stops.playing(lambda: None), pytest.raises(Aborted, match="Ctrl-C"):
        raise_signal(signal.SIGINT)


def test_what_is_being_saved_is_saved_whole_before_the_request_counts(stops: StopRequests) -> None:
    saved = False
    with pytest.raises(Aborted, match="SIGTERM"), stops.saving():
        raise_signal(signal.SIGTERM)
        saved = True
    assert saved


def test_a_signal_after_the_last_tick_is_outstanding_until_somebody_asks(stops: StopRequests) -> None:
    with stops.deferring():
        with stops.playing(lambda: None):
            stops.poll()
            raise_signal(signal.SIGINT)
        assert stops.outstanding() == "Stopped by Ctrl-C"
        assert stops.outstanding() is None  # whoever asked acts on it


def test_a_signal_after_the_last_tick_counts_at_the_end_of_the_saving(stops: StopRequests) -> None:
    with stops.playing(lambda: None):
        stops.poll()
        raise_signal(signal.SIGINT)
    with pytest.raises(Aborted, match="Ctrl-C"), stops.saving():
        pass


def test_what_a_tick_has_read_is_not_raised_a_second_time(stops: StopRequests) -> None:
    with stops.deferring():
        with stops.playing(lambda: None):
            stops.poll()
            raise_signal(signal.SIGTERM)
            assert stops.poll() is not None
        raise_signal(signal.SIGTERM)
    with stops.saving():
        pass
    assert stops.outstanding() is None


def test_handlers_from_before_are_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with StopRequests().handling_signals():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


class Struck:
    """Raises a signal where what is raised is dropped: while it is taken away."""

    def __del__(self) -> None:
        raise_signal(signal.SIGINT)


def test_a_ctrl_c_that_strikes_where_nothing_can_be_raised_strikes_again(
    stops: StopRequests, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(Aborted, match="Stopped by Ctrl-C"):
        Struck()
        time.sleep(60.0)  # it does not last
    assert stops.outstanding() == "Stopped by Ctrl-C"
    assert capsys.readouterr().err == ""
