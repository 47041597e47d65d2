"""The fuzz runs themselves: they hold on a few of their inputs, and they notice what they are there to notice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fuzz_configs, fuzz_recordings
from benchmarks.fuzz import can_targets, checksums, files
from benchmarks.fuzz.can_targets import clocks, regular_clocks
from benchmarks.fuzz.framed import check_framing
from benchmarks.fuzz.streams import Pieces
from benchmarks.fuzz.targets import TARGETS, seeds
from benchmarks.fuzz_codecs import NAMES, mutated
from drivers.codecs import checksums as own
from drivers.codecs.framing import BAD_CHECKSUM, NOT_A_HEAD

SLOW = frozenset(("refuse empty_lines.csv.gz", "refuse zeros.csv.gz", "refuse nul.csv.gz", "refuse bomb.mat",
                  "refuse bomb.npz", "refuse huge.eds", "any compact.eds", "refuse many.npz"))  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_codec_holds_on_a_few_hostile_streams(name: str) -> None:
    random = np.random.default_rng(7)
    begun = seeds(name)
    went_through = sum(TARGETS[name](data) for data in begun[:4])
    went_through += sum(TARGETS[name](mutated(begun[k % len(begun)], random)) for k in range(12))
    assert went_through > 1000


def test_regular_clocks_are_stamped_anew_so_that_what_is_said_of_them_is_looked_at(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drive, gyro = regular_clocks()
    assert clocks(drive) == len(drive) and clocks(gyro) == len(gyro)
    monkeypatch.setattr(can_targets, "MAX_CORRECTION_S", -1.0)
    for regular in (drive, gyro):
        with pytest.raises(AssertionError, match="too far"):
            clocks(regular)


def test_every_target_is_named() -> None:
    assert set(NAMES) == set(TARGETS)


@pytest.mark.parametrize(
    ("here", "there"),
    [
        (own.crc32_mpeg2, checksums.kvh_crc),
        (own.crc8_07, checksums.utility_crc),
        (own.crc16_xmodem, checksums.vectornav_crc),
        (own.xor8, checksums.nmea_sum),
        (own.sum8, checksums.byte_sum),
    ],
)
def test_two_independent_checksums_agree(here: Callable[[bytes], int], there: Callable[[bytes], int]) -> None:
    random = np.random.default_rng(3)
    for length in (0, 1, 2, 3, 4, 37, 300):
        data = random.bytes(length)
        assert here(data) == there(data)


def test_a_matcher_that_lets_a_wrong_checksum_pass_is_noticed() -> None:
    def careless(buffer: bytes, position: int) -> int:
        return 4 if buffer[position] == 0x90 and len(buffer) - position >= 4 else NOT_A_HEAD

    with pytest.raises(AssertionError, match="wrong checksum"):
        check_framing(careless, Pieces(b"\x90abc", ()), lambda packet: packet[-1] == 0, 5)


def test_a_framer_that_depends_on_the_reads_is_noticed() -> None:
    def impatient(buffer: bytes, position: int) -> int:
        return 4 if len(buffer) - position >= 4 else BAD_CHECKSUM

    with pytest.raises(AssertionError, match="cut into reads"):
        check_framing(impatient, Pieces(b"abcdefgh", (3,)), lambda packet: True, 5)


@pytest.mark.skipif(not hasattr(__import__("os"), "mkfifo"), reason="pipes in the file system are POSIX")
def test_configurations_hold_on_a_few_mutations() -> None:
    said: list[str] = []
    outcomes = fuzz_configs.run(120, 3, said.append)
    assert not said
    assert outcomes["refused"] > 60 and outcomes["loaded"] > 0


@pytest.mark.parametrize("name", files.MAKERS)
def test_recordings_hold_on_a_few_mutations(tmp_path: Path, name: str) -> None:
    outcomes = fuzz_recordings.batch(name, 12, 5, tmp_path)
    assert outcomes["BROKE"] == 0 and outcomes.total() == 12
    (tmp_path / name).unlink()
    files.MAKERS[name](tmp_path / name)
    assert fuzz_recordings.one(tmp_path / name) == "read"  # as it is made it can be read


@pytest.mark.parametrize("name", [name for name in files.HARMFUL if name not in SLOW])
def test_a_file_made_to_do_harm_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name.partition(" ")[2]
    files.HARMFUL[name](path)
    assert fuzz_recordings.one(path) == ("refused" if name.startswith("refuse") else "read")
    assert not files.WITNESS.exists()
