"""`rig init`: a commented rig.yaml from the columns of a recording, or from the ports of this machine."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from commands.rig.init_questions import (
    LISTED,
    NONE,
    Ask,
    Questions,
    column_named,
    factor_from,
    show,
)
from commands.rig.init_yaml import Entry, number_value, recorded_yaml, text_value
from commands.terminal.exit_codes import OK
from rig.errors import RecordingError, UsageError

if TYPE_CHECKING:
    from rig.recording.guessing.columns import Column
    from rig.recording.guessing.roles import Choice, Quantity
    from rig.recording.table import Table

ORDER: tuple[Quantity, ...] = ("time", "torque", "rate", "angle")  # in the file


@dataclass(frozen=True)
class InitOptions:
    """What was asked for: columns and factors by quantity as typed, and where to write."""

    columns: dict[Quantity, str] = field(default_factory=dict)
    scales: dict[Quantity, str] = field(default_factory=dict)
    axis: str | None = None
    out: Path = Path("rig.yaml")
    yes: bool = False

    @classmethod
    def of(
        cls, columns: Sequence[str | None], scales: Sequence[str | None], axis: str | None, out: Path, yes: bool
    ) -> InitOptions:  # fmt: skip
        """From what was typed for time, torque, rate and angle, in this order."""
        given = [{q: t for q, t in zip(ORDER, texts, strict=True) if t} for texts in (columns, scales)]
        return cls(given[0], given[1], axis, out, yes)


def init(source: Path | None, options: InitOptions, ask: Ask | None) -> int:
    """Write a rig.yaml; returns the exit code.

    Parameters
    ----------
    source
        A recording, or None for a bench.
    ask
        Puts a question and returns the answer; None where nobody can answer.

    Raises
    ------
    UsageError
        Where the file to be written exists, or something has to be known that nobody said.
    RecordingError
        Where the recording cannot be read.
    """
    out = options.out
    if options.axis not in (None, "rotary", "linear"):
        raise UsageError(f"--axis {options.axis!r:.40} is not allowed: give rotary or linear")
    if out.exists() or out.is_symlink():
        raise UsageError(f"{out} exists and is never overwritten: give another name with --out")
    if source is None:
        return _bench(options)
    from rig.recording.readers import read_file
    from rig.recording.run import Run

    contents = read_file(source)
    file = _relative(source, out)
    if all(isinstance(content, Run) for content in contents):
        show([f"{source}: a recording of this program; its columns and units are known"])
        typed = next(iter([*options.columns, *[f"{q}-scale" for q in options.scales]]), None)
        if typed is not None:
            raise UsageError(f"{source} is a recording of this program, whose columns are known: leave out --{typed}")
        text = recorded_yaml(file, f"{len(contents)} runs", (), (), options.axis or "rotary", out.name)
    else:
        table = next(content for content in contents if not isinstance(content, Run))
        text = _of_table(table, file, options, ask)
    _write(out, text, checked=True)
    show(["", f"{out}: written. Next: rig check {out}"])
    return OK


def terminal() -> Ask | None:
    """What asks the person at the terminal; None where there is nobody."""
    if sys.stdin is None or not sys.stdin.isatty() or not sys.stderr.isatty():
        return None

    def ask(question: str) -> str:
        sys.stderr.write(question)
        sys.stderr.flush()
        answer = sys.stdin.readline()
        if not answer:
            raise UsageError("no answer was given, so nothing was written: give the options (rig init --help)")
        return answer

    return ask


def _bench(options: InitOptions) -> int:
    from commands.rig.init_bench import bench_text

    named = next(iter({**options.columns, **options.scales}), None)
    if named is not None:
        raise UsageError(f"an option about the {named} was given without a recording: name the file, `rig init FILE`")
    text, seen = bench_text(options.out.name)
    show(seen)
    _write(options.out, text, checked=False)
    show(["", f"{options.out}: written. Fill in what it marks, then: identify-run {options.out} --emulate"])
    return OK


def _of_table(table: Table, file: str, options: InitOptions, ask: Ask | None) -> str:
    from rig.recording.guessing.clocks import with_one_clock
    from rig.recording.guessing.columns import columns_of
    from rig.recording.guessing.roles import guess_roles
    from rig.recording.guessing.scales import axis_of, guess_factors
    from rig.recording.tables import DEFAULT_NAMES

    columns = columns_of(table)
    show(_listing(table, columns))
    named: dict[Quantity, Column | None] = {q: column_named(columns, q, text) for q, text in options.columns.items()}
    questions = Questions(options.yes, ask)
    guessed = with_one_clock(guess_roles(columns, named), columns, next(iter(DEFAULT_NAMES["time"])))
    _refuse_unread(table, columns, guessed, options)
    roles = {q: questions.column(q, choice, columns) for q, choice in guessed.items()}
    if roles["time"].column is None:
        questions.finish()
    _require_motion(table, roles)
    axis = options.axis or axis_of(roles)
    factors = guess_factors(roles, axis, {q: list(DEFAULT_NAMES[q]) for q in roles})
    for q, text in options.scales.items():
        if q not in factors:
            raise UsageError(f"--{q}-scale was given, but there is no column of the {q}: add --{q} COL")
        factors[q] = factor_from(q, text, axis)
    found: list[tuple[Quantity, Column]] = [(q, c) for q in ORDER if (c := roles[q].column) is not None]
    written = {*options.scales, *(q for q, factor in factors.items() if not factor.sure)}
    factors = {q: questions.factor(q, factors[q], column, axis) for q, column in found}
    questions.finish()
    entries = [
        Entry(q, text_value(c.name), f"{roles[q].why}; {factors[q].why}", questions.is_guess(q, "column"))
        for q, c in found
    ]
    # Said in the file too: by itself the reader takes a column of a usual name.
    entries += [
        Entry(q, NONE, "not read, as you said", False) for q in ORDER if roles[q].column is None and roles[q].said
    ]
    scales = [
        Entry(q, number_value(value), factors[q].why, questions.is_guess(q, "scale"))
        for q, c in found
        if (value := factors[q].value) is not None and (value != 1.0 or q in written or c.unit_text)
    ]  # fmt: skip
    about = f"{max(len(c.values) for c in columns if c.values is not None)} rows"
    return recorded_yaml(file, about, entries, scales, axis, options.out.name)


def _listing(table: Table, columns: tuple[Column, ...]) -> list[str]:
    """The columns as a person looks at them: unit, range, and what cannot be read."""
    import numpy as np

    lines = [f"{table.path}: {len(columns)} columns"]
    for c in columns[:LISTED]:
        if c.values is None:
            lines.append(f"  {c.name!r}: not usable: {c.why_not}")
            continue
        rising = ", increases" if c.increases else ""
        unit = f" {c.known_unit.text if c.known_unit else c.unit_text}".rstrip()
        lines.append(f"  {c.name!r}: {np.nanmin(c.values):.6g} to {np.nanmax(c.values):.6g}{unit}{rising}")
    return lines + ([f"  ... and {len(columns) - LISTED} more"] if len(columns) > LISTED else [])


def _refuse_unread(
    table: Table, columns: tuple[Column, ...], roles: dict[Quantity, Choice], options: InitOptions
) -> None:  # fmt: skip
    """A torque that is there and cannot be read must not make a free decay of the recording."""
    from rig.recording.guessing.roles import unread

    for quantity in ORDER:
        column = unread(columns, quantity)
        if roles[quantity].column is None and column is not None and quantity not in options.columns:
            none = f" (or {NONE})" if quantity in ("rate", "angle") else ""
            why = column.why_not.removeprefix(f"column {column.name!r} ")
            raise RecordingError(
                f"{table.path}: column {column.name!r} looks like the {quantity} but cannot be used: {why}; or give "
                f"another column with --{quantity} COL{none}"
            )


def _require_motion(table: Table, roles: dict[Quantity, Choice]) -> None:
    if roles["rate"].column is None and roles["angle"].column is None:
        raise UsageError(f"{table.path}: no rate and no angle was named or found: give --rate COL or --angle COL")


def _relative(source: Path, out: Path) -> str:
    """The recording as the configuration names it: relative to its folder where that is possible."""
    try:
        return Path(os.path.relpath(source.resolve(), out.resolve().parent)).as_posix()
    except ValueError:  # another drive of Windows
        return source.resolve().as_posix()


def _write(out: Path, text: str, checked: bool) -> None:
    """Write the file, once it has proved to be one that reads the recording."""
    partial = out.with_name(f"{out.name}.part")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8", newline="\n")
        if checked:
            _check(partial)
        with out.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise UsageError(f"{out} exists and is never overwritten: give another name with --out") from None
    except OSError as error:
        raise UsageError(f"{out} cannot be written ({error.strerror}): give another place with --out") from None
    finally:
        partial.unlink(missing_ok=True)


def _check(path: Path) -> None:
    from rig.config.load import load_config
    from rig.recording.load import read_recording

    try:
        read_recording(load_config(path))
    except RecordingError as error:
        raise RecordingError(f"{_as_options(str(error))}\nNothing was written.") from None


def _as_options(message: str) -> str:
    """What to set in rig.yaml, said as the option of `rig init` that sets it."""
    text = re.sub(r"recorded\.scale\.(time|torque|rate|angle): ", r"--\1-scale ", message)
    return re.sub(r"recorded\.(scale|columns)\.(time|torque|rate|angle)", lambda m: _option(m[1], m[2]), text)


def _option(section: str, quantity: str) -> str:
    return f"--{quantity}-scale" if section == "scale" else f"--{quantity}"
