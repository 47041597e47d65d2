"""The server of the live page: this machine only, with the token only, and a stop button that arrives."""

from __future__ import annotations

import http.client
import json
import threading
from collections.abc import Iterator, Mapping
from http.server import ThreadingHTTPServer
from typing import Any

import pytest

from commands.live.server import HOST, LiveProcess, handler_of
from commands.live.view import STOP_REASON, live_view

TOKEN = "a-token-for-the-test"
Said = list[Mapping[str, Any]]


@pytest.fixture
def said() -> Said:
    return []


@pytest.fixture
def port(said: Said) -> Iterator[int]:
    """A server in this process."""
    server = ThreadingHTTPServer((HOST, 0), handler_of(LiveProcess(said.append), TOKEN))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    yield server.server_port
    server.shutdown()
    server.server_close()
    thread.join()


def asked(port: int, method: str, path: str, **headers: str) -> tuple[int, str, Mapping[str, str]]:
    """Status, body and headers of an answer."""
    connection = http.client.HTTPConnection(HOST, port, timeout=5)
    connection.request(method, path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    body = answer.read().decode()
    connection.close()
    return answer.status, body, dict(answer.headers)


def test_with_the_token_the_page_and_the_state_are_served_and_nothing_may_be_fetched_elsewhere(port: int) -> None:
    status, body, headers = asked(port, "GET", f"/{TOKEN}/")
    assert status == 200 and "STOP: torque off" in body and "NONCE" not in body
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "http://" not in body and "https://" not in body
    status, body, _ = asked(port, "GET", f"/{TOKEN}/state")
    assert (status, json.loads(body)["phase"]) == (200, "waiting")


@pytest.mark.parametrize("path", ["/", "/state", "/wrong/", "/wrong/state", f"/{TOKEN[:-1]}/", "//"])
def test_without_the_token_nothing_is_said(port: int, path: str) -> None:
    assert asked(port, "GET", path)[0] == 403


def test_a_name_from_elsewhere_that_points_here_is_refused(port: int) -> None:
    assert asked(port, "GET", f"/{TOKEN}/state", Host="evil.example:80")[0] == 403


def test_the_stop_button_needs_the_header_that_no_other_site_can_send(port: int, said: Said) -> None:
    assert asked(port, "POST", f"/{TOKEN}/stop")[0] == 403
    assert asked(port, "POST", f"/{TOKEN}/stop", X_Token="wrong")[0] == 403
    assert said == []
    assert asked(port, "POST", f"/{TOKEN}/stop", X_Token=TOKEN)[0] == 200
    assert said == [{"stop": True}]


def test_the_process_of_the_page_passes_a_stop_on_and_shows_what_it_is_told() -> None:
    stopped, announced = threading.Event(), list[str]()
    reasons: list[str] = []

    def stop(reason: str) -> None:
        reasons.append(reason)
        stopped.set()

    with live_view(stop, announced.append) as view:
        port, token = announced[0].removeprefix(f"live view: http://{HOST}:").strip("/").split("/")
        view.note("looking at what is left")
        for _ in range(100):
            state = json.loads(asked(int(port), "GET", f"/{token}/state")[1])
            if state["notes"]:
                break
        assert state["notes"] == ["looking at what is left"]
        asked(int(port), "POST", f"/{token}/stop", X_Token=token)
        assert stopped.wait(5.0)
    assert reasons == [STOP_REASON]
