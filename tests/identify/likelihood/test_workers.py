"""Fits side by side: in their order, and over when one is interrupted."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event

import pytest

from identify.likelihood.workers import Workers


def test_fits_come_back_in_their_order_and_share_no_threads_with_their_parts() -> None:
    workers = Workers()

    def fit(k: int) -> Callable[[], int]:
        return lambda: sum(workers.map(lambda x: k * x, range(100)))

    assert workers.side_by_side([fit(k) for k in range(5)]) == [k * 4950 for k in range(5)]


def test_an_interrupted_fit_ends_the_one_beside_it_and_leaves_the_workers_usable() -> None:
    workers, begun = Workers(), Event()

    def endless() -> int:
        begun.set()
        while True:
            list(workers.map(abs, (1, 2)))

    def interrupted() -> int:
        begun.wait()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        workers.side_by_side([interrupted, endless])
    assert workers.side_by_side([lambda: 1, lambda: 2]) == [1, 2]
