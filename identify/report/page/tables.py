"""The tables of the report: parameters, errors, candidates, sets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

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
from identify.report.page.markup import Markup, Piece, bullets, element, join, paragraph, table
from identify.report.page.quantities import QUANTITIES
from identify.results import Candidate, Identification, ModelResult, ParameterEstimate
from identify.wording import (
    SYMBOLS,
    bias_percent,
    capital,
    declared_number,
    errors_by_model,
    frequency,
    half_of,
    in_order,
    interval_of,
    number,
    percent,
    plain,
    readable,
    title,
    unit,
    value_of,
)
from rig import effects

ROWS = 60  # of the candidates, best first
SCREENED = "screened out"
NO_INFO: Mapping[str, Any] = {}
# What result.json calls "no better", as the reason is.
NO_BETTER, LESS_LIKELY = "no better", "less likely than the one added"
SIMPLER_ADDED = "a simpler effect was added instead"


def parameter_table(identification: Identification) -> Markup:
    """Before and after with intervals, and how far the declared model bends each parameter."""
    before, after = identification.before, identification.after
    bent = bias_percent(identification)
    lost = [item.name for item in (after or before).not_determined if item.name in SYMBOLS]
    names = list(dict.fromkeys([*before.parameters, *(after.parameters if after else ()), *lost]))
    given = [DECLARED_VALUE] if identification.declared else []
    rows: list[list[Piece]] = []
    for name in names:
        row: list[Piece] = [title(name, identification.axis)]
        row += [declared_number(identification, name, None) for _ in given]
        row += _estimate(before, name)
        row += [*_estimate(after, name), percent(bent.get(name))] if after else []
        rows.append([*row, _unit_of(name, before, after)])
    rows += _effect_rows(identification)
    head = ["", *given, DECLARED_FIT, "95 % interval"]
    head += [FINAL_FIT, "95 % interval", f"{DECLARED_FIT} off by"] if after else []
    return table(
        [*head, "unit"],
        rows,
        "Fitted to all samples not declared held out. Declared model: only its own terms, without the added effects."
        + (" Declared value: the number under model: in the configuration, not used by the fit." if given else ""),
    )


def _effect_rows(identification: Identification) -> list[list[Piece]]:
    before, after = identification.before, identification.after
    rows: list[list[Piece]] = []
    for effect, parameters in (after or before).effect_parameters.items():
        for name, estimate in parameters.items():
            earlier = before.effect_parameters.get(effect, {}).get(name)
            cells: list[Piece] = [f"{plain(effect)}, {name.replace('_', ' ')}"]
            if identification.declared:
                cells.append(declared_number(identification, f"{effect}.{name}", estimate))
            cells += _cells(_scaled_as(earlier, estimate))
            cells += [*_cells(readable(estimate)), ""] if after else []
            rows.append([*cells, unit(readable(estimate).unit)])
    return rows


def _scaled_as(earlier: ParameterEstimate | None, shown: ParameterEstimate) -> ParameterEstimate | None:
    """In the unit that the row is shown in."""
    both = earlier is not None and readable(earlier).unit == readable(shown).unit
    return readable(earlier) if earlier is not None and both else earlier


def _estimate(model: ModelResult | None, name: str) -> tuple[Piece, Piece]:
    if model is None or name in model.parameters:
        return _cells(model.parameters[name] if model else None)
    absent = {item.name: "dropped" for item in model.dropped}
    absent |= {item.name: "not determined" for item in model.not_determined}
    return absent.get(name, "-"), ""


def _cells(estimate: ParameterEstimate | None) -> tuple[Piece, Piece]:
    return ("-", "") if estimate is None else (value_of(estimate), interval_of(estimate))


def _unit_of(name: str, *models: ModelResult | None) -> str:
    return next((unit(m.parameters[name].unit) for m in models if m and name in m.parameters), "")


def error_table(identification: Identification, info: Mapping[str, Any] = NO_INFO) -> Markup:
    """Each measure of error before, after, and at the noise floor; ``info`` is what the recording says of itself."""
    q, floor = QUANTITIES[identification.axis], identification.noise_floor
    channel = identification.traces[0] if identification.traces else None
    name, channel_unit = q.measured(channel) if channel else (q.rate, q.rate_unit)
    kinds: list[tuple[str, str, str, float | None]] = [
        (simulation_error(name), "holdout_rate_rms", channel_unit, floor.holdout_rate_rms),
        (REPRODUCED, "holdout_fit_percent", "%", None),
        (f"{q.torque} residual, rms", "residual_rms_torque", q.torque_unit, floor.residual_rms_torque),
        (f"{q.torque} residual over {q.torque}", "residual_torque_relative", "%", None),
        ("the same, held-out samples", "holdout_torque_relative", "%", None),
    ]
    models = errors_by_model(identification)
    rows: list[list[Piece]] = []
    for words, key, its_unit, least in kinds:
        values = [getattr(error, key) for error in models.values()]
        if all(value is None for value in values):
            continue
        times = 100.0 if key.endswith("_relative") else 1.0
        shown = [number(None if value is None else times * value) for value in values]
        rows.append([words, *shown, number(least), its_unit])
    head = ["", *models, "noise floor", "unit"]
    cutoff = identification.final.error.lowpass_hz
    note = f" {capital(q.torque)} residuals after a zero-phase low-pass at {cutoff:g} Hz." if cutoff else ""
    return table(head, rows, f"Error before and after. {SIMULATED} {noise_floor_sentence(floor, info)}{note}")


def candidate_table(candidates: Sequence[Candidate], floor: float) -> Markup:
    """All that was tried, by round, best first."""
    if not candidates:
        return paragraph("No effect was tried.")
    fitted = [c for c in candidates if c.status != SCREENED]
    order = sorted(fitted, key=lambda c: (c.round, c.delta_bic))
    added = {c.round: c.delta_bic for c in reversed(order) if c.status.startswith("added")}  # the best of each round
    rows: list[list[Piece]] = [
        [
            plain(c.effect),
            str(c.round),
            f"{c.delta_bic:+.0f}",
            number(c.holdout_rate_rms),
            _times(c.holdout_rate_rms, floor),
            element("span", c.status, class_="added") if c.status == "added" else _outcome(c, added),
        ]
        for c in order[:ROWS]
    ]
    more = f" The best {ROWS} of {len(order)}; result.json has all." if len(order) > ROWS else ""
    head = ["effect", "round", "evidence", "held-out error", "times the floor", "outcome"]
    caption = (
        "Candidates tried, each added to the model of that round. Evidence: change of the Bayesian information "
        "criterion, scaled down where the data scatter more than the model expects; negative is better."
    )
    if all(c.holdout_rate_rms is None for c in order):  # a search by likelihood has no error of its own a candidate
        head, rows = [*head[:3], head[-1]], [[*row[:3], row[-1]] for row in rows]
        tried = table(head, rows, f"{caption}{more}", words=(3,))
    else:
        caption += f" Held-out error in units of the measured channel; the noise floor is {number(floor)}."
        tried = table(head, rows, f"{caption}{more}", words=(4, 5))
    return join([tried, _screened_out([c for c in candidates if c.status == SCREENED])])


def _outcome(candidate: Candidate, added: Mapping[int, float]) -> str:
    """What became of it; a lower BIC than that of the effect that was added asks for the reason."""
    if candidate.status != NO_BETTER or candidate.round not in added:
        return candidate.status
    return SIMPLER_ADDED if candidate.delta_bic < added[candidate.round] else LESS_LIKELY


def _screened_out(several: Sequence[Candidate]) -> Markup:
    """What a quick look at the residual ruled out, folded away: one line a round."""
    rounds = sorted({c.round for c in several})
    lines = [
        f"Round {r}: " + ", ".join(plain(c.effect) for c in sorted(several, key=lambda c: c.delta_bic) if c.round == r)
        for r in rounds
    ]
    head = f"Screened out by the residual, without a full fit ({len(several)})"
    return element("details", element("summary", head), bullets(lines)) if lines else Markup("")


def _times(value: float | None, floor: float) -> Piece:
    """How many times the noise floor, with a bar on a logarithmic scale."""
    if value is None or not (value > 0.0 and floor > 0.0):
        return ""
    length = min(140.0, max(1.0, 40.0 * math.log10(max(1.0, value / floor))))
    bar = element("span", class_="bar", style=f"width:{length:.0f}px")
    return join([bar, f" {number(value / floor, 3)}"])


def set_table(identification: Identification) -> Markup:
    """Each set fitted for itself with the effects of the final model."""
    sets = identification.per_set
    names = in_order(name for one in sets for name in one.parameters)
    units = {n: next(unit(one.parameters[n].unit) for one in sets if n in one.parameters) for n in names}
    head: list[Piece] = ["set", "frequency"]
    head += [join([SYMBOLS.get(n, plain(n)), element("small", f" ({units[n]})")]) for n in names]
    head += ["objective", SEARCH_REPEATS, BELOW_J_DEC, "remark"]
    rows: list[list[Piece]] = []
    for one in sets:
        values = [_with_half(one.parameters.get(n)) for n in names]
        passed = "yes" if one.accepted else "NO"
        rows.append([one.name, frequency(one.frequency_hz), *values, number(one.objective), str(one.restarts), passed])
        rows[-1].append(one.advice)
    scatter = identification.set_scatter
    if scatter:
        spread: list[Piece] = [number(scatter[n], 2) if n in scatter else "-" for n in names]
        rows.append([OVER_THE_SETS, "", *spread, "", "", "", ""])
    totals = identification.max_error_percent
    if totals:
        shown: list[Piece] = [f"{number(totals[n], 2)} %" if n in totals else "-" for n in names]
        rows.append(["Max_Error (Eq. 15)", "", *shown, "", "", "", "against identify.reference"])
    caption = (
        "Each set fitted separately, with the effects of the final model. Plus or minus: half the 95 % interval. "
        + J_DEC
    )
    if not any(one.frequency_hz is not None and frequency(one.frequency_hz) != one.name for one in sets):
        head.pop(1)  # the name says it already
        for row in rows:
            row.pop(1)
    if not any(row[-1] for row in rows):
        head, rows = head[:-1], [row[:-1] for row in rows]
        return table(head, rows, caption)
    return table(head, rows, caption, words=(len(head) - 1,))


def _with_half(estimate: ParameterEstimate | None) -> Piece:
    if estimate is None:
        return "not determined"
    return join([value_of(estimate), element("small", f" ± {half_of(estimate)}")])


def correlation_table(correlation: Mapping[str, float]) -> Markup:
    """Pairs of parameters that the data tie together, strongest first."""
    strong = sorted(correlation.items(), key=lambda item: -abs(item[1]))
    rows: list[list[Piece]] = [[_pair(names), f"{value:+.3f}"] for names, value in strong[:12]]
    return table(["pair", "correlation"], rows, "Correlation of the final estimates.") if rows else Markup("")


def _pair(names: str) -> str:
    """ "damping, coulomb_friction.level" as "damping and Coulomb friction level"."""
    return " and ".join(plain(name.replace(".", " ")) for name in names.split(", "))


def effect_cards(identification: Identification) -> Markup:
    """What each effect that was added is, with its equation, sign and source; its numbers stand in the table."""
    known = set(effects.known())
    return join(_card(identification, name) for name in identification.verdict.effects if name in known)


def _card(identification: Identification, name: str) -> Markup:
    effect = effects.get(name)
    given = identification.final.effect_parameters.get(name, {})
    meanings = [f"{p.name.replace('_', ' ')}: {p.meaning}" for p in effect.parameters if p.name in given]
    return element(
        "article",
        element("h3", capital(plain(name))),
        paragraph(effect.meaning),
        element("pre", effect.equation, tabindex="0", role="region", aria_label=f"Equation of {plain(name)}"),
        bullets([*meanings, effect.sign, f"Source: {effect.source}."]),
        class_="card",
    )
