"""Text files that end in the middle of a number, have words for lost readings, or a column that says how it went."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from commands.rig.app import app
from identify.runs.reading import describe_reading
from rig.recording.run import Run
from tests.commands.support import command
from tests.rig.recording.support import motion, read

NAMES = ("time_s", "torque_nm", "rate_rad_s")


def lines(form: str = "{:.4f}", by: str = ",", count: int = 400) -> list[str]:
    columns = [motion(count)[name] for name in NAMES]
    return [by.join(form.format(float(v)) for v in row) for row in zip(*columns, strict=True)]


def run_of(folder: Path, body: str, by: str = ",", file: str = "run.csv", encoding: str = "utf-8") -> tuple[Run, str]:
    """The run, and what is said of how it was read."""
    data = (by.join(NAMES) + "\n" + body).encode(encoding)
    (folder / file).write_bytes(gzip.compress(data) if file.endswith(".gz") else data)
    (run,) = read(folder, file).runs
    return run, " ".join(describe_reading([run], lambda _: None))


CUT = {
    "within the last number": ("\n".join(lines())[:-2], "ends in '"),
    "within an exponent": ("\n".join(lines("{:.6e}"))[:-1], "ends in '-1.936813e+0', shorter"),
    "before the last number": ("\n".join(lines()[:-1]) + "\n0.3990,2.9768,", "ends without a last number"),
    "before the last column": ("\n".join(lines()[:-1]) + "\n0.3990,2.97", "has 2 of 3 fields"),
    "with a line end": ("\n".join(lines()[:-1]) + "\n0.3990\n", "has 1 of 3 fields"),
    "a word at the end": ("\n".join(lines()[:-1]) + "\nEOF\n", "has 1 of 3 fields"),
    "of varying length": ("\n".join(lines("{!r}"))[:-14], "ends in '"),
}


@pytest.mark.parametrize("case", CUT)
def test_a_last_line_that_is_cut_is_left_out_and_told(case: str, tmp_path: Path) -> None:
    body, how = CUT[case]
    run, said = run_of(tmp_path, body)
    assert len(run.time_s) == 399 and run.valid.all()
    assert run.rate_rad_s is not None
    np.testing.assert_allclose(run.rate_rad_s, motion(399)["rate_rad_s"], atol=1e-4)
    assert f"Of run.csv, the last line {how}" in said and "as of a file that was cut, and is left out" in said


@pytest.mark.parametrize(
    ("file", "encoding", "by"),
    [
        ("run.csv", "utf-16", "\t"),
        ("run.csv", "utf-16-be", "\t"),
        ("run.csv.gz", "utf-8", ";"),
        ("run.csv", "cp1252", ";"),
    ],
)
def test_it_is_seen_in_every_encoding(file: str, encoding: str, by: str, tmp_path: Path) -> None:
    run, said = run_of(tmp_path, "\n".join(lines("{:.9f}", by))[:-4], by, file, encoding)
    assert len(run.time_s) == 399 and "the last line ends in" in said


@pytest.mark.parametrize("form", ["{:.4f}", "{:.6e}", "{!r}"])
@pytest.mark.parametrize("end", ["", "\n", "\r\n", "\n\n"])
def test_a_whole_last_line_is_kept_with_and_without_a_line_end(form: str, end: str, tmp_path: Path) -> None:
    run, said = run_of(tmp_path, "\n".join(lines(form)) + end)
    assert len(run.time_s) == 400 and said == ""


@pytest.mark.parametrize("word", ["#N/A", "-1.#IND", "OVERLOAD", "∞", "---", "NaN", "TIMEOUT", "Out of Range"])
def test_a_word_in_the_place_of_a_number_is_a_lost_row(word: str, tmp_path: Path) -> None:
    rows = lines()
    for i in (0, 17, 18):
        rows[i] = rows[i].rpartition(",")[0] + "," + word
    run, said = run_of(tmp_path, "\n".join(rows) + "\n")
    assert np.flatnonzero(~run.valid).tolist() == [16, 17] and len(run.time_s) == 399
    assert "1 at the beginning and 2 within, no rate" in said


def test_a_column_that_says_how_it_went_is_told(tmp_path: Path) -> None:
    rows = [f"{line},{'FAULT' if i == 16 else 'TIMEOUT' if i in (40, 41) else 'OK'}" for i, line in enumerate(lines())]
    (tmp_path / "run.csv").write_text(",".join([*NAMES, "status"]) + "\n" + "\n".join(rows) + "\n")
    done = command(app, "init", tmp_path / "run.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 0
    said = "column 'status' is 'OK' in 397 rows and 'TIMEOUT' in 2 (first in line 42), 'FAULT' in 1 (first in line 18)"
    assert said in done.stdout and "add a column valid that is 0 there" in done.stdout


@pytest.mark.parametrize("as_categories", [False, True])
def test_a_column_of_a_parquet_file_that_says_how_it_went_is_told(as_categories: bool, tmp_path: Path) -> None:
    words = pa.array(["OK"] * 16 + ["FAULT", None] + ["OK"] * 382)
    columns = {name: motion(400)[name] for name in NAMES}
    table = pa.table({**columns, "state": words.dictionary_encode() if as_categories else words})
    pq.write_table(table, tmp_path / "run.parquet")
    (run,) = read(tmp_path, "run.parquet").runs
    (said,) = describe_reading([run], lambda _: None)
    assert "'state' is 'OK' in 398 rows and 'FAULT' in 1 (first in row 17), '' in 1 (first in row 18)" in said


@pytest.mark.parametrize("words", [["OK"], [""] * 40 + ["begun"], [f"row {i}" for i in range(30)]])
def test_a_column_of_words_that_says_nothing_of_the_rows_is_not_told(words: list[str], tmp_path: Path) -> None:
    rows = [f"{line},{words[i % len(words)]}" for i, line in enumerate(lines())]
    (tmp_path / "run.csv").write_text(",".join([*NAMES, "status"]) + "\n" + "\n".join(rows) + "\n")
    (run,) = read(tmp_path, "run.csv").runs
    assert describe_reading([run], lambda _: None) == ()
