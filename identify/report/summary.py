"""The summary on the terminal: what a person reads aloud when a campaign is over."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from identify.conclude.expected_delay import delay_lines
from identify.conclude.headline import accepted_or_not
from identify.conclude.next_steps import next_steps
from identify.follow_up.wording import lines as follow_up_lines
from identify.proof.wording import lines as proof_lines
from identify.report.captions import (
    BELOW_J_DEC,
    DECLARED_FIT,
    DECLARED_VALUE,
    FINAL_FIT,
    J_DEC,
    OVER_THE_SETS,
    REPRODUCED,
    SEARCH_REPEATS,
    SIMULATED,
    noise_floor_sentence,
    simulation_error,
)
from identify.results import Identification, ParameterEstimate
from identify.wording import (
    SYMBOLS,
    bias_percent,
    capital,
    declared_number,
    errors_by_model,
    in_order,
    not_said_yet,
    number,
    percent,
    plain,
    printable,
    readable,
    sentence,
    title,
    unit,
    value_of,
    with_interval,
)

PLAIN_WIDTH = 96  # characters, where no terminal says how wide it is
# Rules of plain dashes: a log file and a Windows console show them as they are.
RULES = box.Box("    \n    \n -- \n    \n    \n    \n    \n    \n", ascii=True)


ON_ONE_LINE = 12  # characters of a heading, as long as "undetermined": longer ones are stacked
NO_INFO: Mapping[str, Any] = {}


def summary(
    identification: Identification, width: int = PLAIN_WIDTH, colour: bool = False, info: Mapping[str, Any] = NO_INFO
) -> str:
    """The whole summary as text of at most ``width`` columns; with ``colour`` in ANSI colours, for a terminal.

    ``info`` is what the recording says of itself.
    """
    console = Console(
        file=io.StringIO(),
        width=width,
        force_terminal=colour,
        color_system="standard" if colour else None,
        highlight=False,
        markup=False,
        emoji=False,
        legacy_windows=False,
    )
    with console.capture() as captured:
        console.print(_whole(identification, info, narrow=width < PLAIN_WIDTH))
    return "\n".join(line.rstrip() for line in captured.get().splitlines()) + "\n"


NONE_DETERMINED = "These runs determine none of the parameters."


def _whole(identification: Identification, info: Mapping[str, Any], narrow: bool) -> Group:
    final, verdict, floor = identification.final, identification.verdict, identification.noise_floor
    note = printable(sentence(identification.holdout_note))
    parts: list[RenderableType] = [
        *_listed("Verdict", verdict.sentences, bullet=""),
        Text(),
        table if (table := _parameters(identification, narrow)).row_count else Text(NONE_DETERMINED),
        Text(),
        _errors(identification),
        Padding(Text(f"{SIMULATED} {noise_floor_sentence(floor, info)} {note}"), (0, 0, 0, 2)),
        *_listed("Torque delay", delay_lines(identification, info), bullet=""),
        *_listed("Dropped: not supported by the data", not_said_yet(final.dropped, identification)),
        *_listed("Not determined by these data", not_said_yet(final.not_determined, identification)),
        *_listed("Follow-up", follow_up_lines(identification.follow_up) if identification.follow_up else ()),
        *_listed("Proof", proof_lines(identification.proof) if identification.proof else ()),
    ]
    if identification.per_set:
        parts += [Text(), _sets(identification), Padding(Text(J_DEC), (0, 0, 0, 2))]
    return Group(*parts, Text(), *_outcome(identification))


def _listed(heading: str, lines: Sequence[str], bullet: str = "- ") -> list[RenderableType]:
    if not lines:
        return []
    body = [Padding(Text(printable(f"{bullet}{line}")), (0, 0, 0, 2)) for line in lines]
    return [Text(), Text(heading, style="bold"), *body]


def _outcome(identification: Identification) -> list[RenderableType]:
    lines = list(identification.reasons)
    if identification.aborted:
        head = Text("ABORTED: stopped early; these results use what was complete by then.", style="bold red")
    elif identification.accepted:
        head = Text("ACCEPTED", style="bold green")
        lines = [accepted_or_not(identification).removeprefix("Accepted: ")]
    else:
        head = Text("NOT ACCEPTED", style="bold red")
    why = [Padding(Text(printable(f"- {capital(line)}")), (0, 0, 0, 2)) for line in lines]
    return [head, *why, *_listed("What to run next", next_steps(identification))]


def _table(heading: str, columns: Sequence[str], words: Sequence[int] = (0,)) -> Table:
    made = Table(
        title=heading,
        title_justify="left",
        title_style="bold",
        box=RULES,
        pad_edge=False,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i in words else "right", overflow="fold")
    return made


def _stacked(words: str) -> str:
    """Long words on two lines, as evenly as they go."""
    if len(words) <= ON_ONE_LINE:
        return words
    at = min((i for i, c in enumerate(words) if c == " "), key=lambda i: abs(2 * i - len(words)), default=None)
    return words if at is None else f"{words[:at]}\n{words[at + 1 :]}"


def _parameters(identification: Identification, narrow: bool) -> Table:
    """The declared and the final model; on a narrow terminal the intervals of the final one stand below its values."""
    before, after, bent = identification.before, identification.after, bias_percent(identification)
    names = list(dict.fromkeys([*before.parameters, *(after.parameters if after else ())]))
    given = [DECLARED_VALUE] if identification.declared else []
    head = ["", *given, DECLARED_FIT, *(["off by", FINAL_FIT] if after else []), "unit"]
    head = [_stacked(column) for column in head]
    table = _table("Parameters, with 95 % intervals", head, words=(0, len(head) - 1))
    for name in names:
        first, last = before.parameters.get(name), (after or before).parameters.get(name)
        more = [percent(bent.get(name)), _estimate(last, narrow)] if after else []
        shown = last or first
        number_given = [declared_number(identification, name, None) for _ in given]
        name_of_row, unit_of_row = title(name, identification.axis), unit(shown.unit) if shown else ""
        table.add_row(name_of_row, *number_given, _estimate(first), *more, unit_of_row)
    for effect, parameters in (after or before).effect_parameters.items():
        for name, found in parameters.items():
            earlier = before.effect_parameters.get(effect, {}).get(name)
            shown = found if earlier is not None and readable(earlier).unit != readable(found).unit else readable(found)
            first = earlier if earlier is None or shown is found else readable(earlier)
            more = ["", _estimate(shown, narrow)] if after else []
            number_given = [declared_number(identification, f"{effect}.{name}", found) for _ in given]
            name_of_row = f"{plain(effect)}, {name.replace('_', ' ')}"
            table.add_row(name_of_row, *number_given, _estimate(first), *more, unit(shown.unit))
    return table


def _estimate(estimate: ParameterEstimate | None, below: bool = False) -> str:
    if estimate is None:
        return "-"
    value, sign, interval = with_interval(estimate).partition(" ")
    return f"{value}{chr(10) if below else sign}{interval}"


def _errors(identification: Identification) -> Table:
    models = errors_by_model(identification)
    floor = identification.noise_floor
    linear = identification.axis == "linear"
    angle = bool(identification.traces) and identification.traces[0].channel == "angle"
    channel = ("position" if linear else "angle") if angle else ("speed" if linear else "rate")
    channel_unit = {"rate": "rad/s", "angle": "rad", "speed": "m/s", "position": "m"}[channel]
    torque, torque_unit = ("force", "N") if linear else ("torque", "N·m")
    kinds: list[tuple[str, str, float | None, str]] = [
        (simulation_error(channel), "holdout_rate_rms", floor.holdout_rate_rms, channel_unit),
        (REPRODUCED, "holdout_fit_percent", None, "%"),
        (f"{torque} residual", "residual_rms_torque", floor.residual_rms_torque, torque_unit),
        (f"residual / {torque}, held out", "holdout_torque_relative", None, "%"),
    ]
    head = ["", *models, "noise floor", "unit"]
    table = _table("Error", head, words=(0, len(head) - 1))
    for words, key, least, its_unit in kinds:
        values = [getattr(error, key) for error in models.values()]
        if any(value is not None for value in values):
            times = 100.0 if key.endswith("_relative") else 1.0
            shown = [number(None if value is None else times * value) for value in values]
            table.add_row(words, *shown, number(least), its_unit)
    return table


def _sets(identification: Identification) -> Table:
    """Each set fitted separately; Max_Error (Eq. 15) below where the truth was given."""
    sets = identification.per_set
    names = in_order(name for one in sets for name in one.parameters)
    table = _table(
        "Each set fitted separately",
        ["set", *[SYMBOLS.get(n, plain(n)) for n in names], *map(_stacked, (BELOW_J_DEC, SEARCH_REPEATS))],
    )
    for one in sets:
        values = [value_of(one.parameters[n]) if n in one.parameters else "undetermined" for n in names]
        table.add_row(printable(one.name), *values, "yes" if one.accepted else "NO", str(one.restarts))
    scatter = identification.set_scatter
    if scatter:
        table.add_row(_stacked(OVER_THE_SETS), *[number(scatter[n], 2) if n in scatter else "-" for n in names], "", "")
    totals = identification.max_error_percent
    if totals:
        table.add_row("Max_Error", *[f"{number(totals[n], 2)} %" if n in totals else "-" for n in names], "", "")
    return table
