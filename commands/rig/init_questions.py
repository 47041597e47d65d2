"""What `rig init` cannot know from a file: asked on a terminal, guessed on request, else named as missing options."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

from commands.rig.init_yaml import number_value
from commands.terminal.display import plain
from commands.terminal.exit_codes import say
from rig.errors import UsageError
from rig.signals import NO_COLUMN

if TYPE_CHECKING:
    from rig.recording.guessing.columns import Column
    from rig.recording.guessing.roles import Choice, Quantity
    from rig.recording.guessing.scales import Factor
    from rig.recording.table import Table

Ask = Callable[[str], str]
Answer = TypeVar("Answer")
NONE = NO_COLUMN  # as an answer: there is no such column
MAX_ANSWER_TRIES = 3
MAX_COLUMNS_SHOWN = 40  # columns
SAMPLE_RATE = "--sample-rate"
_OF_A_TIME = f"--time COL, or {SAMPLE_RATE} HZ if the rows are evenly spaced"
# What may be said besides a column: every recording has a time, and one without torque is another experiment.
_OR_NONE = {
    "time": "",
    "torque": f", or --torque {NONE} if the platform moved freely",
    "rate": ", or --angle COL",
    "angle": ", or --rate COL",
}


def show(lines: Sequence[str]) -> None:
    """Lines to stdout, without what could steer a terminal."""
    sys.stdout.writelines(f"{plain(line)}\n" for line in lines)
    sys.stdout.flush()


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


def listing(table: Table, columns: tuple[Column, ...]) -> list[str]:
    """The columns as a person looks at them: unit, range, and what cannot be read."""
    import numpy as np

    lines = [f"{table.path}: {len(columns)} columns"]
    for c in columns[:MAX_COLUMNS_SHOWN]:
        if c.values is None:
            lines.append(f"  {c.name!r}: not usable: {c.why_not}")
            continue
        rising = ", increases" if c.increases else ""
        unit = f" {c.known_unit.text if c.known_unit else c.unit_text}".rstrip()
        instead = f", and {c.instead} for no reading" if c.instead else ""
        lines.append(f"  {c.name!r}: {np.nanmin(c.values):.6g} to {np.nanmax(c.values):.6g}{unit}{rising}{instead}")
    return lines + ([f"  ... and {len(columns) - MAX_COLUMNS_SHOWN} more"] if len(columns) > MAX_COLUMNS_SHOWN else [])


def column_named(columns: tuple[Column, ...], quantity: str, name: str) -> Column | None:
    """The column of that name; None for "none". Raises UsageError."""
    found = next((c for c in columns if c.name == name and c.values is not None), None)
    if found is not None or (name == NONE and quantity != "time"):
        return found
    usable = ", ".join(repr(c.name) for c in columns[:MAX_COLUMNS_SHOWN] if c.values is not None)
    none = "" if quantity == "time" else f", or {NONE}"
    raise UsageError(f"--{quantity} {name[:60]!r} is no column of numbers: choose one of {usable}{none}")


def column_option(quantity: str) -> str:
    """How a column is given, and how it is said that there is none."""
    return f"--{quantity} COL{_OR_NONE[quantity]}"


def factor_from(quantity: str, text: str, axis: str) -> Factor:
    """A factor as typed: a number, or a unit. Raises UsageError."""
    from rig.recording.guessing.scales import Factor
    from rig.units import DIMENSIONS, SI, unit_of

    dimension = DIMENSIONS[axis][quantity]
    try:
        value = float(text)
    except ValueError:
        unit = unit_of(text)
        if unit is None or unit.dimension != dimension:
            raise UsageError(
                f"--{quantity}-scale {text[:40]!r} is neither a number nor a known unit of {dimension}: give the "
                f"factor to {SI[dimension]}, e.g. 0.001, or a unit"
            ) from None
        return Factor(unit.factor, f"{unit.text}, as given", True)
    if value == 0.0 or not abs(value) < float("inf"):
        raise UsageError(f"--{quantity}-scale {text} is not allowed: give a factor to {SI[dimension]} other than zero")
    return Factor(value, f"factor to {SI[dimension]}, as given", True)


def rate_from(text: str) -> float:
    """Rows a second as typed. Raises UsageError."""
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = 0.0
    if not 0.0 < rate_hz <= 1e9:
        raise UsageError(
            f"{SAMPLE_RATE} {text[:40]!r} is not allowed: give the rows a second, a number above 0, at most 1e9"
        )
    return rate_hz


class Questions:
    """Asks what is not sure, or takes the guess, or remembers that somebody has to say it."""

    def __init__(self, yes: bool, ask: Ask | None) -> None:
        self._yes, self._ask = yes, None if yes else ask
        self._guessed: set[tuple[str, str]] = set()
        self._missing: list[str] = []
        self._have_guesses = True

    @property
    def can_ask(self) -> bool:
        """Whether there is somebody to answer."""
        return self._ask is not None

    def is_guess(self, quantity: str, what: str) -> bool:
        """Whether the "column" or "scale" of a quantity is a guess that nobody confirmed."""
        return (quantity, what) in self._guessed

    def column(self, quantity: Quantity, choice: Choice, columns: tuple[Column, ...]) -> Choice:
        """The choice, once it is sure. Raises UsageError where no answer can be used."""
        from rig.recording.guessing.roles import Choice

        if choice.sure:
            return choice
        guess = choice.column.name if choice.column else ""
        if self._ask is not None:
            none = "" if quantity == "time" else f"; {NONE}: there is none"
            said = f"guess: {choice.why}" if guess else choice.why
            question = f"Which column is the {quantity}? ({plain(said)}{none}) {f'[{plain(guess)}] ' if guess else ''}"
            found = self._answer(question, guess, lambda text: column_named(columns, quantity, text))
            return Choice(found, "as answered", True, said=True)
        if guess:
            option = _OF_A_TIME if quantity == "time" else f"--{quantity} COL"
            self._take(quantity, "column", guess, choice.why, option)
        else:
            self._miss(f"{quantity}: {choice.why}: give {column_option(quantity)}")
        return choice

    def factor(self, quantity: Quantity, found: Factor, column: Column, axis: str) -> Factor:
        """The factor, once it is sure. Raises UsageError where no answer can be used."""
        if found.sure:
            return found
        guess = "" if found.value is None else number_value(found.value)
        if self._ask is not None:
            said = f"(guess: {plain(found.why)}) [{guess}]" if guess else f"({plain(found.why)})"
            question = f"Unit of {plain(column.name)!r}, or factor to SI units? {said} "
            return self._answer(question, guess, lambda text: factor_from(quantity, text, axis))
        option = f"--{quantity}-scale FACTOR (or a unit)"
        option += f", or {SAMPLE_RATE} HZ" if quantity == "time" and found.value is None else ""
        if found.value is None:
            self._miss(f"{quantity}: column {column.name!r}: {found.why}: give {option}")
        else:
            self._take(quantity, "scale", guess, found.why, option)
        return found

    def sample_rate(self, stated: tuple[str, float] | None) -> float | None:
        """Rows a second, in Hz, of a file without a time; None where nobody says it. ``stated``: what the file does."""
        guess, why = ("", "") if stated is None else (number_value(stated[1]), f"{stated[0]!r} in the file says so")
        if self._ask is not None:
            said = f"; guess: {plain(why)}" if guess else ""
            question = f"No column is a time. How many rows a second, in Hz{said}? {f'[{guess}] ' if guess else ''}"
            return self._answer(question, guess, rate_from)
        if stated is None:
            self._miss(f"time: no column is a time: give {_OF_A_TIME}")
            return None
        self._take("time", "sample rate", f"{guess} Hz", why, _OF_A_TIME)
        return stated[1]

    def finish(self) -> None:
        """Raise UsageError that lists everything that somebody has to say."""
        if self._missing:
            listed = "".join(f"\n  {line}" for line in self._missing)
            accept = ", or accept the guesses with --yes" if self._have_guesses else ""
            raise UsageError(f"not clear from the file; nothing was written. Give the options{accept}:{listed}")

    def _answer(self, question: str, guess: str, read: Callable[[str], Answer]) -> Answer:
        assert self._ask is not None
        for _ in range(MAX_ANSWER_TRIES):
            try:
                return read(self._ask(question).strip() or guess)
            except UsageError as error:
                say(str(error))
        raise UsageError(
            f"no answer that could be used in {MAX_ANSWER_TRIES} tries: give it as an option (rig init --help)"
        )

    def _miss(self, line: str) -> None:
        """Something that nobody can guess."""
        self._missing.append(line)
        self._have_guesses = False

    def _take(self, quantity: str, what: str, guess: str, why: str, option: str) -> None:
        if self._yes:
            self._guessed.add((quantity, what))
            show([f"guess: {quantity}: {what} {guess!r} ({why})"])
        else:
            self._missing.append(f"{quantity}: {what} {guess!r} is a guess ({why}): give {option}")
