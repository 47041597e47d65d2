"""Compiled kernels find a place to be kept, and never one that others may write."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from pathlib import Path

import pytest

from rig.compiled_cache import VARIABLE, ensure_compiled_cache

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="permissions work otherwise there")


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    """An installation, a home and a temporary folder; what is not writable is what a test says is not."""
    found = {name: tmp_path / name for name in ("package", "home", "tmp")}
    for path in found.values():
        path.mkdir()
    monkeypatch.setenv("HOME", str(found["home"]))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setattr(tempfile, "tempdir", str(found["tmp"]))
    return found


def forbid(monkeypatch: pytest.MonkeyPatch, *folders: Path) -> None:
    """Refuse writing there, for root too."""
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) not in folders and access(path, mode))


def test_a_writable_installation_needs_nothing(places: dict[str, Path]) -> None:
    ensure_compiled_cache(places["package"])
    assert not os.environ[VARIABLE]


def test_a_writable_home_will_do(places: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    forbid(monkeypatch, places["package"])
    ensure_compiled_cache(places["package"])
    assert not os.environ[VARIABLE]


def test_where_neither_can_be_written_a_private_temporary_folder_is_used_again_and_again(
    places: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    forbid(monkeypatch, places["package"], places["home"])
    ensure_compiled_cache(places["package"])
    chosen = Path(os.environ[VARIABLE])
    assert chosen.parent == places["tmp"]
    assert stat.S_IMODE(chosen.stat().st_mode) == 0o700
    monkeypatch.setenv(VARIABLE, "")
    ensure_compiled_cache(places["package"])
    assert Path(os.environ[VARIABLE]) == chosen


def test_a_folder_that_others_may_write_is_not_used(places: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    forbid(monkeypatch, places["package"], places["home"])
    planted = places["tmp"] / f"isp-rig-compiled-{os.getuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    ensure_compiled_cache(places["package"])
    assert Path(os.environ[VARIABLE]) != planted


def test_a_choice_of_the_user_stands(places: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "/their/own")
    ensure_compiled_cache(places["package"])
    assert os.environ[VARIABLE] == "/their/own"
