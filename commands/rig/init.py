"""`rig init`: a commented rig.yaml from the columns of a recording, or from the ports of this machine."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from commands.rig.init_questions import (
    NONE,
    SAMPLE_RATE,
    Ask,
    Questions,
    column_named,
    factor_from,
    listing,
    rate_from,
    show,
)
from commands.rig.init_target import exists_already
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
    sample_rate_hz: float | None = None

    @classmethod
    def of(
        cls,
        columns: Sequence[str | None],
        scales: Sequence[str | None],
        axis: str | None,
        out: Path,
        yes: bool,
        sample_rate: str | None,
    ) -> InitOptions:
        """From what was typed for time, torque, rate and angle, in this order. Raises UsageError."""
        given = [{q: t for q, t in zip(ORDER, texts, strict=True) if t} for texts in (columns, scales)]
        rate_hz = None if sample_rate is None else rate_from(sample_rate)
        if rate_hz is not None and ("time" in given[0] or "time" in given[1]):
            option = "--time" if "time" in given[0] else "--time-scale"
            raise UsageError(f"{SAMPLE_RATE} and {option} were both given: {SAMPLE_RATE} is for files without a time")
        return cls(given[0], given[1], axis, out, yes, rate_hz)

    def first(self) -> str | None:
        """The first option about columns, None where none was given."""
        named = [*(f"--{q}" for q in self.columns), *(f"--{q}-scale" for q in self.scales)]
        return next(iter([*named, *([SAMPLE_RATE] if self.sample_rate_hz is not None else [])]), None)


def init(sources: Sequence[Path], options: InitOptions, ask: Ask | None) -> int:
    """Write a rig.yaml; returns the exit code.

    Parameters
    ----------
    sources
        Recordings of the same columns, one a run; none for a bench.
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
        raise exists_already(out, sources)
    if not sources:
        return _bench(options)
    from rig.recording.readers import read_file
    from rig.recording.run import Run

    for one in sources:
        _check_is_there(one)
    source, files = sources[0], [_relative(one, out) for one in sources]
    contents = read_file(source)
    if all(isinstance(content, Run) for content in contents):
        show([f"{source}: a recording of this program; its columns and units are known"])
        if options.first() is not None:
            raise UsageError(
                f"{source} is a recording of this program, whose columns are known: leave out {options.first()}"
            )
        text = recorded_yaml(files, f"{len(contents)} runs", (), (), options.axis or "rotary", out.name)
    else:
        table = next(content for content in contents if not isinstance(content, Run))
        text = _of_table(table, files, options, ask)
    _write(out, text, sources)
    show(["", f"{out}: written. Next: rig check {out}, then identify-run {out}"])
    return OK


def expanded(sources: Sequence[Path]) -> list[Path]:
    """The files, patterns expanded where the shell did not, as on Windows; a pattern that fits none is kept."""
    out: list[Path] = []
    for source in sources:
        found = [] if _is_there(source) else sorted(source.parent.glob(source.name))
        out += found or [source]
    return out


def _is_there(source: Path) -> bool:
    """Whether there is something to read, or to be told by the reader why it cannot be."""
    try:
        return source.exists() or source.is_symlink()
    except OSError:
        return True


def _check_is_there(source: Path) -> None:
    from rig.recording.readers import neighbours

    if _is_there(source):
        return
    pattern = ": no file fits the pattern" if any(sign in source.name for sign in "*?[") else ": no such file"
    raise UsageError(f"{source}{pattern}: correct the path{neighbours(source)}")


def _bench(options: InitOptions) -> int:
    from commands.rig.init_bench import bench_text

    if options.first() is not None:
        raise UsageError(f"{options.first()} was given without a recording: name the file, `rig init FILE`")
    text, seen = bench_text(options.out.name)
    show(seen)
    _write(options.out, text, ())
    show(["", f"{options.out}: written. Fill in what it marks, then: identify-run {options.out} --emulate"])
    return OK


def _of_table(table: Table, files: Sequence[str], options: InitOptions, ask: Ask | None) -> str:
    from rig.recording.guessing.columns import columns_of
    from rig.recording.guessing.factor import Factor
    from rig.recording.guessing.roles import unused_rate
    from rig.recording.guessing.sampling import stated_rate
    from rig.recording.guessing.scales import axis_of, guess_factors
    from rig.recording.tables import DEFAULT_NAMES

    columns = columns_of(table)
    show(listing(table, columns))
    questions = Questions(options.yes, ask)
    roles, rate_hz = _roles(table, columns, options, questions)
    axis = options.axis or axis_of(roles)
    factors = guess_factors(roles, axis, {q: list(DEFAULT_NAMES[q]) for q in roles})
    if rate_hz is not None:
        factors["time"] = Factor(1.0 / rate_hz, f"{rate_hz:g} rows a second", True)
    elif factors["time"].value is None and not factors["time"].sure and (stated := stated_rate(columns)) is not None:
        factors["time"] = Factor(1.0 / stated[1], f"{stated[1]:g} rows a second, as {stated[0]!r} says", False)
    for q, text in options.scales.items():
        if q not in factors:
            raise UsageError(f"--{q}-scale was given, but there is no column of the {q}: add --{q} COL")
        factors[q] = factor_from(q, text, axis)
    # A column without a name is the time that the file does not have.
    found: list[tuple[Quantity, Column]] = [(q, c) for q in ORDER if (c := roles[q].column) is not None and c.name]
    written = {*options.scales, *(q for q, factor in factors.items() if not factor.sure)}
    factors = {q: questions.factor(q, factors[q], column, axis) for q, column in found}
    questions.finish()
    show(unused_rate(columns, roles))
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
    rate = None
    if rate_hz is not None and "time" not in factors:
        is_guess = questions.is_guess("time", "sample rate")
        rate = Entry("sample_rate_hz", number_value(rate_hz), "rows a second; the file has no time", is_guess)
    about = f"{max(len(c.values) for c in columns if c.values is not None)} rows"
    return recorded_yaml(files, about, entries, scales, axis, options.out.name, rate)


def _roles(
    table: Table, columns: tuple[Column, ...], options: InitOptions, questions: Questions
) -> tuple[dict[Quantity, Choice], float | None]:
    """The column of every quantity, and the rows a second of a file without a time. Raises UsageError."""
    from rig.recording.guessing.clocks import with_one_clock
    from rig.recording.guessing.roles import Choice, guess_roles
    from rig.recording.guessing.sampling import even_time, sample_counter, stated_rate
    from rig.recording.tables import DEFAULT_NAMES

    named: dict[Quantity, Column | None] = {q: column_named(columns, q, text) for q, text in options.columns.items()}
    rate_hz = options.sample_rate_hz
    guessed = guess_roles(columns, named)
    if rate_hz is None:
        _refuse_unread(table, columns, guessed, options)
        if guessed["time"].column is None:
            rate_hz = questions.sample_rate(stated_rate(columns))
            guessed["time"] = Choice(None, "asked for", True)
    if rate_hz is not None:
        # A counter also counts the rows that were lost.
        guessed = guess_roles(columns, {**named, "time": sample_counter(columns) or even_time(columns, rate_hz)})
        _refuse_unread(table, columns, guessed, options)
    guessed = with_one_clock(guessed, columns, next(iter(DEFAULT_NAMES["time"])))
    roles = {q: questions.column(q, choice, columns) for q, choice in guessed.items()}
    if roles["rate"].column is None and roles["angle"].column is None and roles["rate"].sure:
        if ask_angle := questions.can_ask and "angle" not in named:
            missing = Choice(None, "a rate or an angle is needed", False)
            roles["angle"] = questions.column("angle", missing, columns)
        if not ask_angle or roles["angle"].column is None:
            raise UsageError(f"{table.path}: no rate and no angle was named or found: give --rate COL or --angle COL")
    if roles["time"].column is None:
        questions.finish()
    return roles, rate_hz


def _refuse_unread(
    table: Table, columns: tuple[Column, ...], roles: dict[Quantity, Choice], options: InitOptions
) -> None:  # fmt: skip
    """A torque that is there and cannot be read must not make a free decay of the recording."""
    from rig.recording.guessing.roles import unread

    for quantity in ORDER:
        column = unread(columns, quantity)
        if roles[quantity].column is None and column is not None and quantity not in options.columns:
            none = f" (or {NONE})" if quantity in ("rate", "angle") else ""
            none = f", or {SAMPLE_RATE} HZ if the rows are evenly spaced" if quantity == "time" else none
            why = column.why_not.removeprefix(f"column {column.name!r} ")
            raise RecordingError(
                f"{table.path}: column {column.name!r} looks like the {quantity} but cannot be used: {why}; or give "
                f"another column with --{quantity} COL{none}"
            )


def _relative(source: Path, out: Path) -> str:
    """The recording as the configuration names it: relative to its folder where that is possible."""
    try:
        return Path(os.path.relpath(source.resolve(), out.resolve().parent)).as_posix()
    except ValueError:  # another drive of Windows
        return source.resolve().as_posix()


def _write(out: Path, text: str, sources: Sequence[Path]) -> None:
    """Write the file, once it has proved to be one that reads its recordings; a bench has none."""
    partial = out.with_name(f"{out.name}.part")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8", newline="\n")
        if sources:
            show(_read_with(partial))
        with out.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise exists_already(out, sources) from None
    except OSError as error:
        raise UsageError(f"{out} cannot be written ({error.strerror}): give another place with --out") from None
    finally:
        partial.unlink(missing_ok=True)


def _read_with(path: Path) -> Sequence[str]:
    """What was made of the recording as this configuration reads it. Raises RecordingError."""
    from identify.runs.reading import describe_reading
    from rig.config.load import load_config
    from rig.recording.load import read_recording

    try:
        return describe_reading(read_recording(load_config(path)).runs, lambda _: None)
    except RecordingError as error:
        raise RecordingError(f"{_as_options(str(error))}\nNothing was written.") from None


def _as_options(message: str) -> str:
    """What to set in rig.yaml, said as the option of `rig init` that sets it."""
    text = re.sub(r"recorded\.scale\.(time|torque|rate|angle): ", r"--\1-scale ", message)
    text = re.sub(r"recorded\.columns\.(torque|rate|angle): ", r"--\1 ", text)
    return re.sub(r"recorded\.(scale|columns)\.(time|torque|rate|angle)", lambda m: _option(m[1], m[2]), text)


def _option(section: str, quantity: str) -> str:
    return f"--{quantity}-scale" if section == "scale" else f"--{quantity}"
