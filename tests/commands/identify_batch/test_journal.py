"""The journal of finished rows: what a kill, a second program or another file does to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from commands.identify_batch.journal import RowJournal, journal_path
from commands.identify_batch.row import COLUMNS, Row
from rig.errors import UsageError


def row(path: str, name: str = "") -> Row:
    return dict.fromkeys(COLUMNS) | {"path": path, "name": name, "inertia_value": 0.1 + 0.2}


def test_rows_come_back_exactly_and_the_newest_of_a_path_counts(tmp_path: Path) -> None:
    with RowJournal(tmp_path / "t.journal") as journal:
        for one in (row("a"), row("b"), row("a", "again")):
            journal.append(one)
    with RowJournal(tmp_path / "t.journal") as journal:
        assert journal.rows == {"a": row("a", "again"), "b": row("b")}


@pytest.mark.parametrize("left", [1, 40, 400])
def test_a_line_that_a_kill_has_cut_costs_that_row_alone(tmp_path: Path, left: int) -> None:
    path = tmp_path / "t.journal"
    with RowJournal(path) as journal:
        journal.append(row("a"))
        whole = path.stat().st_size
        journal.append(row("b"))
    with path.open("r+b") as file:
        file.truncate(whole + left)
    with RowJournal(path) as journal:
        assert list(journal.rows) == ["a"]
        journal.append(row("c"))
    with RowJournal(path) as journal:
        assert list(journal.rows) == ["a", "c"]


def test_a_head_that_a_kill_has_cut_is_an_empty_journal(tmp_path: Path) -> None:
    (tmp_path / "t.journal").write_bytes(b'{"format": "isp')
    with RowJournal(tmp_path / "t.journal") as journal:
        assert journal.rows == {}
        journal.append(row("a"))
    with RowJournal(tmp_path / "t.journal") as journal:
        assert list(journal.rows) == ["a"]


def test_a_second_program_on_the_same_table_is_refused(tmp_path: Path) -> None:
    with RowJournal(tmp_path / "t.journal"), pytest.raises(UsageError, match="another identify-batch is writing"):
        RowJournal(tmp_path / "t.journal")


@pytest.mark.parametrize("text", ["notes\n", "notes", '{"format": "isp-rig batch journal", "version": 1}\n[1]\n'])
def test_another_file_is_refused_and_left_as_it_is(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.journal"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match="no journal of identify-batch"):
        RowJournal(path)
    assert path.read_text(encoding="utf-8") == text


def test_the_journal_lies_beside_its_table() -> None:
    assert journal_path(Path("out") / "t.parquet") == Path("out") / "t.parquet.journal"
