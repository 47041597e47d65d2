"""The table of constants that decide a name is the code's: every one is there, with its value, and none is unjudged."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-an-effect-is-named.md"
PACKAGES = ("select", "likelihood", "propose", "rivals")
ALSO = ("bounds/separation.py",)
ORIGINS = ("derivation: ", "reference: ", "calibration run: ", "set by hand")
# Judged by hand: these cost time, guard the arithmetic, or shape what is shown. None of them gives another name.
DECIDE_NOTHING: Mapping[str, str] = {
    "bounds/separation.py": "ROUNDING",
    "likelihood/by_prediction_error.py": "FINAL_FIT_ITERATIONS MAX_FINAL_FIT_SAMPLES NUMBERS_OF_A_DISTURBANCE "
    "SHIFT_STEP UNIFORM_VARIANCE",
    "likelihood/derivatives.py": "GAIN_STEP MOTION_STEP NOISE_STEP RUNAWAY_SIGMAS",
    "likelihood/damped_step.py": "LEAST_DAMPING LEVENBERG_DAMPING MAX_STEP_TRIALS",
    "likelihood/descent.py": "COARSE_TOLERANCE DIFFERENCE_STEP EARLY_STEPS STALLED_STEPS",
    "likelihood/fit.py": "MAX_LINEAR_INERTIA_CHANGE",
    "likelihood/gyro_biases.py": "BIAS_STEPS",
    "likelihood/kept_gains.py": "GAIN_CACHE_SIZE SAME_STEP",
    "likelihood/noise_grid.py": "WHITE_BESIDE COLOURED_SHARES INITIAL_BIAS_WALK INITIAL_PREFILTER_NOISE "
    "LITTLE_DISTURBANCE WHITE_SHARES",
    "likelihood/normal_equations.py": "COST_TOLERANCE MAX_LOG_STEP MAX_NOISE_FACTOR NORMAL_RCOND",
    "likelihood/other_noise.py": "BIAS_WALK_STARTS CONTINUATION_LEVELS CONTINUATION_STEPS DISTURBANCE_START_FACTORS "
    "EXCHANGED_TIME_FACTORS LARGE_DISTURBANCE MAX_GAP_RATIO MAX_STEPS_ALONE NOISE_START_FACTORS",
    "likelihood/noise_bounds.py": "FAR MAX_DISTURBANCE MAX_ENCODER_ERROR MAX_PREFILTER_NOISE MIN_BIAS_WALK "
    "MIN_DISTURBANCE MIN_PREFILTER_NOISE SHORTEST_SAMPLES",
    "likelihood/prediction_error.py": "LEAST_UNREAD_VARIANCE LONG_RUN_SAMPLES SLOPE_CACHE_SIZE START_ANGLE START_RATE "
    "UNKNOWN_ANGLE",
    "likelihood/settling.py": "LARGEST_SHARE LEAD_SHARE LONGEST_LEAD SETTLING_SAMPLES",
    "likelihood/workers.py": "PATIENCE SHORTEST_WAIT_S",
    "propose/innovation_score.py": "LITTLE SCALED SHAPES",
    "propose/motion_scale.py": "FOLLOWED_LINES",
    "propose/starts.py": "OTHER_START",
    "propose/torque_looks.py": "EVALUATIONS",
    "rivals/own_low_pass.py": "BEGUN_SAMPLES",
    "rivals/run_delays.py": "FIT_STEPS MAX_DELAY_SAMPLES MAX_SHIFT_S RCOND ROUNDS SURE_RATIO",
    "rivals/run_heterogeneity.py": "RUN_CHANGE_ROUNDS",
    "rivals/whole_runs.py": "WHOLE_RUN_STEPS TOLERANCE",
    "select/curve_rivals.py": "MIN_EARLY_CURVE_SHARE",
    "select/forward_selection.py": "MOST_PASSES",
    "select/disturbance_lines.py": "FLOOR_BINS LOWEST_BIN MIN_LINE_SAMPLES NEAR_BINS QUIET_SHARE",
    "select/evidence.py": "MIN_OWN_INFLUENCE_SHARE",
    "select/field_search.py": "NO_WORSE WHOLE_SAMPLES",
    "select/free_form_residual.py": "MIN_CURVE_SCORE CURVE_STEPS CURVES_TRIED",
    "select/likelihood_search.py": "RIVAL_SAMPLES BEYOND_SAMPLES DECLARED_WITHIN MIN_MORE_SAMPLES_RATIO SAMPLES",
    "select/search_state.py": "ANOTHER",
    "select/stepwise.py": "MIN_RIVAL_SHARE PROMISING",
    "select/torque_search.py": "REFINED RIVAL WORTH_EVIDENCE",
    "select/trial_fits.py": "BEHIND COMPARABLE FAINT_SCORE FOLLOWS_LESS FULL_FIT_RATIO "
    "FULL_ITERATIONS HEAVIEST MAX_PAIRS_FITTED MIN_TRIAL_SCORE TRIAL_ITERATIONS TRIED",
}


class Row(NamedTuple):
    """A constant as the page has it."""

    name: str
    file: str
    value: object
    unit: str
    origin: str


def table() -> list[Row]:
    section = PAGE.read_text(encoding="utf-8").split("## The constants that decide a name\n")[1].split("\n## ")[0]
    rows = []
    for line in section.splitlines():
        if line.startswith("| `"):
            name, file, value, unit, _, origin = (cell.strip() for cell in line.strip("|").split(" | "))
            rows.append(Row(name.strip("`"), file.strip("`"), ast.literal_eval(value.strip("`")), unit, origin))
    return rows


def is_numeric(value: object) -> bool:
    """A number, or numbers in tuples and mappings of any depth."""
    if isinstance(value, Mapping):
        return is_numeric(tuple(value.values()))
    if isinstance(value, tuple):
        return bool(value) and all(is_numeric(v) for v in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def constants_of(path: Path) -> dict[str, object]:
    """Name -> value of every numeric constant that a module defines, tuples of names taken apart."""
    names: list[str] = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        names += [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]
    module = import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    values = {name: getattr(module, name) for name in names if name.isupper()}
    return {name: value for name, value in values.items() if is_numeric(value)}


@cache  # every row asks
def in_the_code() -> dict[tuple[str, str], object]:
    paths = [path for package in PACKAGES for path in sorted((ROOT / "identify" / package).rglob("*.py"))]
    paths += [ROOT / "identify" / name for name in ALSO]
    return {
        (path.relative_to(ROOT).as_posix(), name): value for path in paths for name, value in constants_of(path).items()
    }


@pytest.mark.parametrize("row", table(), ids=lambda row: f"{row.file}:{row.name}")
def test_a_constant_of_the_table_has_the_value_that_it_has_in_the_code(row: Row) -> None:
    value = in_the_code().get((row.file, row.name))
    assert value is not None, f"{row.file} has no {row.name}: correct {PAGE.name}"
    assert value == pytest.approx(row.value, rel=1e-3), f"correct {row.name} of {row.file} in {PAGE.name}"
    assert row.unit
    assert row.origin.startswith(ORIGINS)


def test_every_numeric_constant_of_these_packages_has_been_judged() -> None:
    nothing = {(f"identify/{file}", name) for file, names in DECIDE_NOTHING.items() for name in names.split()}
    decide = {(row.file, row.name) for row in table()}
    code = set(in_the_code())
    assert len(decide) == len(table())
    assert nothing & decide == set()
    assert sorted(code - nothing - decide) == [], f"decides it a name? Then a row in {PAGE.name}, else DECIDE_NOTHING"
    assert sorted(nothing - code) == [], "gone from the code: take it out of DECIDE_NOTHING"


def test_the_introduction_counts_the_rows() -> None:
    text, rows = PAGE.read_text(encoding="utf-8"), table()
    counts = re.search(
        r"^(\d+) constants .*?: (\d+) in the search, (\d+) in .*? (\d+) of them are set by hand", text, re.M | re.S
    )
    assert counts is not None
    elsewhere = sum(row.file.startswith("identify/rivals/") for row in rows)
    by_hand = sum(row.origin.startswith("set by hand") for row in rows)
    assert [int(n) for n in counts.groups()] == [len(rows), len(rows) - elsewhere, elsewhere, by_hand]
