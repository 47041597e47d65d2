"""Names from outside are text everywhere: on the terminal, in result.json, in the report, in what is exported."""

from __future__ import annotations

import json
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from commands.identify_run.app import app as identify_run
from commands.rig.app import app
from rig.config.load import load_config
from rig.dynamics import TorqueSignal, simulate
from rig.errors import ConfigError
from rig.platform import Platform
from rig.recording.journal import Journal
from rig.signals import TorqueHold
from tests.commands.support import command

SCRIPT = "<script>alert(1)</script>"
IMAGE = "<img src=x onerror=alert(1)>"
BREAKOUT = "</script></title>\"'><svg onload=alert(1)>"
TURNED = "a\u202egnp.exe"
STEERING = "\x1b[2J\x1b]0;owned\x07"
FORMULA = "=HYPERLINK(1)"
QUICK = ("--set", "identify.candidates=[]", "--set", "identify.genetic={population: 4, generations: 1, restarts: 0}")
SCRIPTS_OF_THE_PAGE = 3  # the figures' data, plotly, the page's own


class Page(HTMLParser):
    """Elements, attributes and texts of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.data: list[str] = []
        self._is_data = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        self._is_data = tag == "script" and dict(attrs).get("type") == "application/json"

    def handle_data(self, data: str) -> None:
        if self._is_data:
            self.data.append(data)
            self._is_data = False


def strings(value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for key, inner in value.items() for text in (key, *strings(inner))]
    if isinstance(value, list):
        return [text for inner in value for text in strings(inner)]
    return [value] if isinstance(value, str) else []


def assert_clean(out: Path) -> None:
    text = (out / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.tags.count("script") == SCRIPTS_OF_THE_PAGE
    assert not {"img", "svg", "iframe", "object"} & set(page.tags)
    assert not [name for name, _ in page.attributes if name.startswith("on")]
    [figures] = page.data
    for shown in strings(json.loads(figures)):  # plotly reads its texts as HTML
        assert "<script" not in shown and "<img" not in shown and "<svg" not in shown
    for steering in ("\u202e", "\x1b", "\x07"):
        assert steering not in text
        assert steering not in (out / "result.json").read_text(encoding="utf-8")


def assert_calm(text: str) -> None:
    assert all(c.isprintable() or c in "\n\r" for c in text), repr(text)


def motion(hold: TorqueHold) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the declared platform, so that nothing is left to look into."""
    time_s = np.arange(1200) * 1e-3
    torque = TorqueSignal(time_s, 20 * np.sin(30 * time_s), hold)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(1200)
    return time_s, torque.torque_nm, simulate(Platform(), time_s, torque).rate_rad_s + noise


def write_journal(path: Path, names: tuple[str, ...]) -> None:
    time_s, torque, rate = motion("zero_order")
    with Journal.create(path, {"noise": 0.001, "config_text": SCRIPT, IMAGE: BREAKOUT}) as journal:
        for name in names:
            journal.begin_run(name, {"torque_hold": "zero_order"}, {"ticks": ("time_s", "late_s", name, IMAGE)})
            journal.append("samples", np.column_stack((time_s, rate, np.ones_like(rate))))
            journal.append("commands", np.column_stack((time_s, torque, torque)))
            journal.append("ticks", np.column_stack((time_s, time_s, torque, rate)))
            journal.event(0.1, SCRIPT, {IMAGE: 1, "aborted": True})
            journal.end_run()


def test_a_journal_full_of_markup_gives_a_clean_report(tmp_path: Path) -> None:
    write_journal(tmp_path / "recording.journal", (SCRIPT + FORMULA, BREAKOUT + TURNED + STEERING))
    config = tmp_path / "rig.yaml"
    config.write_text("backend: recorded\nrecorded: {runs: [{file: recording.journal}]}\n")
    done = command(identify_run, config, "--out", tmp_path / "out", *QUICK)
    assert done.exit_code in (0, 1), done.output
    assert_clean(tmp_path / "out")
    assert_calm(done.stdout + done.stderr)
    for line in (("recover", tmp_path), ("export", tmp_path, "--to", "csv"), ("check", config)):
        said = command(app, *line)
        assert said.exit_code == 0, said.output
        assert_calm(said.stdout + said.stderr)


@pytest.mark.skipif(sys.platform == "win32", reason="such names cannot be given to files there")
def test_files_and_columns_with_markup_in_their_names_give_a_clean_report(tmp_path: Path) -> None:
    time_s, torque, rate = motion("band_limited")
    names = [f"{name.replace('/', '_')}.csv" for name in (SCRIPT + TURNED, IMAGE + STEERING)]
    for name in names:
        rows = "".join(
            f"{a!r},{b!r},{c!r}\n" for a, b, c in zip(*(x.tolist() for x in (time_s, torque, rate)), strict=True)
        )
        (tmp_path / name).write_text(f'"{IMAGE}",torque_nm,"{FORMULA}"\n{rows}')
    runs = json.dumps([{"file": name} for name in names])
    config = tmp_path / "rig.yaml"
    section = f"recorded:\n  columns: {{time: '{IMAGE}', rate: '{FORMULA}'}}\n  runs: {runs}\n"
    config.write_text(f'name: "a & b\'s `c`"\nbackend: recorded\n{section}')
    done = command(identify_run, config, "--out", tmp_path / "out", *QUICK)
    assert done.exit_code in (0, 1), done.output
    assert_clean(tmp_path / "out")
    assert_calm(done.stdout + done.stderr)


def test_sets_with_markup_in_their_names_give_a_clean_report(tmp_path: Path) -> None:
    sets = [
        {"torque_nm": 20, "frequency_hz": hz, "duration_s": 0.5, "name": name}
        for hz, name in ((5, SCRIPT), (9, BREAKOUT))
    ]
    config = tmp_path / "rig.yaml"
    config.write_text(f"backend: simulated\nsimulated: {{}}\nexcitation: {{rest_s: 0.3, sets: {json.dumps(sets)}}}\n")
    done = command(identify_run, config, "--out", tmp_path / "out", *QUICK)
    assert done.exit_code in (0, 1), done.output
    assert_clean(tmp_path / "out")
    assert_calm(done.stdout + done.stderr)


FREE_TEXT = (
    "name", "backend", "model", "model.effects_from", "simulated.platform", "bench.gyroscope.device",
    "bench.gyroscope.port", "bench.gyroscope.settings.x", "bench.amplifier.device", "bench.amplifier.can.interface",
    "bench.amplifier.can.channel", "bench.amplifier.can.options.x", "bench.amplifier.settings.eds", "bench.replay",
    "identify.candidates", "recorded.runs", "recorded.columns.time", "excitation", "nonsense",
)  # fmt: skip


@pytest.mark.parametrize("key", FREE_TEXT)
def test_what_is_said_of_hostile_text_in_a_configuration_steers_no_terminal(tmp_path: Path, key: str) -> None:
    config = tmp_path / "rig.yaml"
    config.write_text("backend: bench\nbench: {}\n")
    for text in (SCRIPT, TURNED, STEERING):
        override = f"{key}={json.dumps(text)}"
        try:
            load_config(config, [override])
        except ConfigError:
            done = command(app, "check", config, "--set", override)
            assert done.exit_code == 2
            assert_calm(done.stderr)
