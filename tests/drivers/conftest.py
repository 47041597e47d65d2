"""The bench that the tests of bench, capture and replay share."""

import pytest

from tests.drivers.wireless import wireless_bench


@pytest.fixture
def bench(monkeypatch, tmp_path):
    return wireless_bench(monkeypatch, tmp_path)
