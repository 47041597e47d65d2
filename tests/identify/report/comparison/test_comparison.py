"""Two results side by side: every difference in words, and larger only where the intervals are apart."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from identify.report.comparison import SavedResult, Section, compare, comparison_html, comparison_text, read_saved
from identify.report.files import result_json
from rig.errors import RecordingError
from tests.identify.sample import sample, unhappy

Content = dict[str, Any]


def content() -> Content:
    """The result.json of a campaign that was accepted: Coulomb friction and a torque delay were found."""
    return dict(json.loads(json.dumps(result_json(sample(2.0)[0]))))


def saved(folder: Path, given: Content) -> SavedResult:
    folder.mkdir(exist_ok=True)
    (folder / "result.json").write_text(json.dumps(given), encoding="utf-8")
    return read_saved(folder)


@pytest.fixture
def compared(tmp_path: Path) -> Callable[..., tuple[Section, ...]]:
    """Compare the accepted campaign with one that a function has changed."""

    def made(change: Callable[[Content], None] = lambda b: None) -> tuple[Section, ...]:
        other = content()
        change(other)
        return compare(saved(tmp_path / "a", content()), saved(tmp_path / "b", other), ("a", "b"))

    return made


def row(sections: tuple[Section, ...], name: str) -> tuple[str, ...]:
    (found,) = [r for section in sections for r in section.rows if r[0] == name]
    return found


def notes(sections: tuple[Section, ...]) -> str:
    return "\n".join(note for section in sections for note in section.notes)


def shifted(name: str, half_widths: float) -> Callable[[Content], None]:
    """Move a parameter by so many half widths of its 95 % interval."""

    def change(b: Content) -> None:
        one = b["after"]["parameters"][name]
        by = half_widths * 0.5 * (one["ci95"][1] - one["ci95"][0])
        one["value"] += by
        one["ci95"] = [bound + by for bound in one["ci95"]]

    return change


def test_a_folder_and_itself_have_nothing_that_changed(compared: Callable[..., tuple[Section, ...]]) -> None:
    sections = compared()
    assert "No parameter that both have changed by more than both intervals." in notes(sections)
    assert row(sections, "damping C")[3:6] == ("0", "0 %", "no")


@pytest.mark.parametrize(
    ("half_widths", "is_larger"), [(1.5, "no"), (1.99, "no"), (2.01, "yes"), (-2.01, "yes"), (-1.9, "no")]
)
def test_a_change_is_larger_than_both_intervals_where_they_do_not_touch(
    compared: Callable[..., tuple[Section, ...]], half_widths: float, is_larger: str
) -> None:
    sections = compared(shifted("damping", half_widths))
    assert row(sections, "damping C")[5] == is_larger
    assert ("Changed by more than both intervals: damping C (" in notes(sections)) == (is_larger == "yes")


def test_intervals_of_different_width_are_both_looked_at(compared: Callable[..., tuple[Section, ...]]) -> None:
    def vague(b: Content) -> None:
        shifted("inertia", 30.0)(b)
        one = b["after"]["parameters"]["inertia"]
        one["ci95"] = [one["ci95"][0] - 1.0, one["ci95"][1] + 1.0]

    assert row(compared(vague), "rotary inertia J")[5] == "no"


def test_an_interval_with_an_open_end_reaches_everywhere_on_that_side(
    compared: Callable[..., tuple[Section, ...]],
) -> None:
    def open_below(b: Content) -> None:
        shifted("inertia", 30.0)(b)
        b["after"]["parameters"]["inertia"]["ci95"][0] = None

    def open_above(b: Content) -> None:
        shifted("inertia", 30.0)(b)
        b["after"]["parameters"]["inertia"]["ci95"][1] = None

    assert row(compared(open_below), "rotary inertia J")[5] == "no"
    assert row(compared(open_above), "rotary inertia J")[5] == "yes"


def test_without_an_interval_nothing_is_judged(compared: Callable[..., tuple[Section, ...]]) -> None:
    def without(b: Content) -> None:
        b["after"]["parameters"]["stiffness"] |= {"ci95": [None, None], "std_error": None, "value": 700.0}

    found = row(compared(without), "stiffness K")
    assert found[5] == "no interval"
    assert found[2] == "700.0"


def test_what_was_dropped_or_is_not_determined_stands_with_its_reason(
    compared: Callable[..., tuple[Section, ...]],
) -> None:
    def lost(b: Content) -> None:
        del b["after"]["parameters"]["damping"], b["after"]["parameters"]["stiffness"]
        b["after"]["dropped"] = [{"name": "damping", "reason": "its interval spans zero"}]
        b["after"]["not_determined"] = [{"name": "stiffness", "reason": "no run is slow enough"}]

    sections = compared(lost)
    assert row(sections, "damping C")[2:6] == ("dropped", "-", "-", "only in A")
    assert row(sections, "stiffness K")[2] == "not determined"
    assert "Damping C is dropped in B: Its interval spans zero." in notes(sections)
    assert "Stiffness K is not determined in B: No run is slow enough." in notes(sections)


def test_a_term_that_neither_determines_is_not_passed_over(tmp_path: Path) -> None:
    a, b = content(), content()
    for one, word in ((a, "dropped"), (b, "not_determined")):
        del one["after"]["parameters"]["damping"]
        one["after"][word] = [{"name": "damping", "reason": "nothing is damped"}]
    sections = compare(saved(tmp_path / "a", a), saved(tmp_path / "b", b), ("a", "b"))
    assert row(sections, "damping C")[1:6] == ("dropped", "not determined", "-", "-", "in neither")


def another_effect(b: Content) -> None:
    """Presliding friction named in the place of Coulomb's, which it may be."""
    level = b["after"]["effect_parameters"].pop("coulomb_friction")["level"]
    b["after"]["effect_parameters"]["presliding_friction"] = {"level": level}
    b["verdict"] |= {
        "effects": ["presliding_friction", "torque_delay"],
        "confusable_with": {"presliding_friction": ["coulomb_friction"], "torque_delay": []},
        "candidates": [{"effect": "coulomb_friction", "status": "rival"}],
    }


def test_other_effects_are_told_with_their_parameters_and_that_they_may_be_the_same(
    compared: Callable[..., tuple[Section, ...]],
) -> None:
    sections = compared(another_effect)
    assert row(sections, "Coulomb friction, level")[2:6] == ("not in the model", "-", "-", "only in A")
    assert row(sections, "presliding friction, level")[5] == "only in B"
    assert row(sections, "Coulomb friction")[2] == "tried: rival"
    assert row(sections, "presliding friction")[1:] == ("tried: rival", "named, or Coulomb friction")
    assert (
        "A names Coulomb friction, B names presliding friction, and the data of B cannot tell the two apart"
        in notes(sections)
    )
    assert "may be due to an effect that only one of them includes" in notes(sections)


def test_an_effect_that_was_declared_is_not_called_found(compared: Callable[..., tuple[Section, ...]]) -> None:
    def declared(b: Content) -> None:
        b["verdict"]["effects"] = ["coulomb_friction"]

    assert row(compared(declared), "torque delay")[1:] == ("named, or actuator lag", "declared")


def test_on_another_axis_nothing_is_judged(compared: Callable[..., tuple[Section, ...]]) -> None:
    def linear(b: Content) -> None:
        b["axis"] = "linear"
        for name, its_unit in (("inertia", "kg"), ("damping", "N*s/m"), ("stiffness", "N/m")):
            shifted(name, 100.0)(b)
            b["after"]["parameters"][name]["unit"] = its_unit

    sections = compared(linear)
    assert row(sections, "axis") == ("axis", "rotary", "linear")
    assert {row(sections, f"{n}")[5] for n in ("rotary inertia J", "damping C", "stiffness K")} == {"other unit"}
    assert row(sections, "rotary inertia J")[2].endswith(" kg")
    assert row(sections, "torque delay, delay")[5] == "other axis"
    assert "quantities differ in kind and are not compared" in notes(sections)
    assert row(sections, "torque residual, final model")[3] == "-"


def test_a_decay_without_torque_has_ratios_only(compared: Callable[..., tuple[Section, ...]]) -> None:
    def decay(b: Content) -> None:
        ratio = {"value": 2.2, "std_error": 0.01, "ci95": [2.18, 2.22], "unit": "1/s"}
        b["after"]["parameters"] = {"damping_over_inertia": ratio}
        b["disturbance"] = None

    sections = compared(decay)
    assert row(sections, "damping C")[2] == "per inertia only"
    assert row(sections, "damping over inertia C/J")[5] == "only in B"
    assert "B has no torque, so only ratios to the inertia are known" in notes(sections)


def test_a_campaign_that_was_stopped_or_refused_says_so(tmp_path: Path) -> None:
    other = dict(json.loads(json.dumps(result_json(unhappy()))))
    sections = compare(saved(tmp_path / "a", content()), saved(tmp_path / "b", other), ("a", "b"))
    assert row(sections, "outcome") == ("outcome", "accepted", "aborted")
    assert "B was stopped: its numbers are those of the samples recorded before." in notes(sections)
    assert "B was not accepted: The residual stays 12 times the noise floor." in notes(sections)


def test_nothing_added_means_that_the_declared_model_is_the_final_one(
    compared: Callable[..., tuple[Section, ...]],
) -> None:
    def nothing(b: Content) -> None:
        b["after"] = None
        b["verdict"] |= {"effects": [], "candidates": []}

    sections = compared(nothing)
    assert row(sections, "effects named")[2] == "none"
    held_out = "held-out error of the measured channel"
    assert row(sections, f"{held_out}, final model")[2] == row(sections, f"{held_out}, declared model")[2]


def test_errors_stand_with_a_factor_and_low_passes_that_differ_are_said(
    compared: Callable[..., tuple[Section, ...]],
) -> None:
    def worse(b: Content) -> None:
        b["after"]["error"]["holdout_rate_rms"] *= 3.0
        b["after"]["error"]["lowpass_hz"] = 12.0

    a_hz = content()["after"]["error"]["lowpass_hz"]
    sections = compared(worse)
    assert row(sections, "held-out error of the measured channel, final model")[3] == "3.00"
    assert ("different low-passes" in notes(sections)) == (a_hz is not None)


def test_another_measure_behind_the_choice_of_a_model_is_said(compared: Callable[..., tuple[Section, ...]]) -> None:
    def by_torque(b: Content) -> None:
        b["after"]["error"]["holdout_measure"] = "holdout_torque_relative"

    assert (
        "Models were chosen by the held-out error of the measured channel in A, by the held-out torque residual in B."
        in notes(compared(by_torque))
    )


def test_a_delay_of_zero_is_in_ms_like_the_one_beside_it(compared: Callable[..., tuple[Section, ...]]) -> None:
    def none(b: Content) -> None:
        b["after"]["effect_parameters"]["torque_delay"]["delay"] |= {"value": 0.0, "ci95": [-1e-6, 1e-6]}

    found = row(compared(none), "torque delay, delay")
    assert found[2] == "0.0000 ± 0.0010"
    assert found[4:] == ("-100 %", "yes", "ms")


def test_the_disturbance_stands_with_what_it_depends_on(compared: Callable[..., tuple[Section, ...]]) -> None:
    def disturbed(b: Content) -> None:
        b["disturbance"] = {
            "torque_rms": 0.02, "unit": "N*m", "relative": 0.004, "moves_percent": {"damping": 2.0},
            "depends_on": [{"on": "angle", "torque_rms": 0.008, "relative": 0.0016, "false_alarm": 1e-6}],
        }  # fmt: skip

    sections = compared(disturbed)
    assert row(sections, "depends on")[2] == "angle (0.0080 N·m)"
    assert row(sections, "moves C by")[1:3] == ("-", "+2.0 %")
    assert row(sections, "share of the torque")[2] == "0.400 %"


def test_the_text_and_the_page_hold_every_cell_and_escape_names(tmp_path: Path) -> None:
    evil = "<script>x</script>\x1b[31m"
    other = content()
    other["verdict"]["effects"].append(evil)
    sections = compare(saved(tmp_path / "a", content()), saved(tmp_path / "b", other), ("a", evil))
    text, page = comparison_text(sections, 200), comparison_html(sections, ("a", evil))
    assert "\x1b" not in text
    assert "<script" not in page and "\x1b" not in page
    for section in sections:
        assert section.title in text and section.title in page
        for cells in section.rows:
            assert len(cells) == len(section.head)
    assert "Content-Security-Policy" in page and "http" not in page.replace("http-equiv", "")


REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "no such folder": (lambda p: None, "there is no such folder"),
    "a file": (lambda p: p.write_text("x"), "is not a folder"),
    "an empty folder": (lambda p: p.mkdir(), "has no result.json: nothing was identified in it"),
    "a folder for a file": (lambda p: (p / "result.json").mkdir(parents=True), "cannot be read"),
    "half a file": (lambda p: written(p, '{"accepted": tr'), "is damaged"),
    "no result": (lambda p: written(p, "{}"), "is no result (SavedResult.accepted is missing)"),
    "a list": (lambda p: written(p, "[]"), "holds list and no result"),
    "a later version": (lambda p: written(p, '{"schema_version": 2}'), "has schema_version 2"),
    "a text for a number": (
        lambda p: written(p, json.dumps(content() | {"accepted": "yes"})),
        "SavedResult.accepted is 'yes'",
    ),
}


def written(folder: Path, text: str) -> None:
    folder.mkdir()
    (folder / "result.json").write_text(text, encoding="utf-8")


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_compared_is_said(tmp_path: Path, case: str) -> None:
    make, message = REFUSED[case]
    make(tmp_path / "x")
    with pytest.raises(RecordingError) as refused:
        read_saved(tmp_path / "x")
    assert message in str(refused.value)
    assert str(tmp_path / "x") in str(refused.value)


def damaged(whole: Any, part: Any, path: tuple[Any, ...] = ()) -> Iterator[Any]:
    """The content with one value after the other replaced by something else."""
    for key in list(part) if isinstance(part, dict) else range(min(len(part), 2)):
        for other in (None, 3, "x", [], {}, True):
            changed = copy.deepcopy(whole)
            inside = changed
            for step in path:
                inside = inside[step]
            inside[key] = other
            yield changed
        if isinstance(part[key], dict | list):
            yield from damaged(whole, part[key], (*path, key))


def test_whatever_stands_in_the_place_of_a_value_is_compared_or_refused(tmp_path: Path) -> None:
    whole = content()
    read = ("accepted", "aborted", "axis", "before", "after", "verdict", "noise_floor", "disturbance", "reasons")
    small = {key: whole[key] for key in read}
    small["verdict"] = {key: small["verdict"][key] for key in ("effects", "confusable_with", "candidates")}
    a, outcomes = saved(tmp_path / "a", whole), {"compared": 0, "refused": 0}
    for changed in damaged(small, small):
        try:
            b = saved(tmp_path / "b", changed)
        except RecordingError:
            outcomes["refused"] += 1
        else:
            for sections in (compare(a, b, ("a", "b")), compare(b, a, ("b", "a"))):
                assert all(len(r) == len(section.head) for section in sections for r in section.rows)
                assert comparison_html(sections, ("a", "b")).startswith("<!DOCTYPE html>")
            outcomes["compared"] += 1
    assert outcomes["refused"] > 200 and outcomes["compared"] > 50, outcomes


@pytest.mark.parametrize(("half_widths", "shown"), [(0.01, "0"), (3.0, "+"), (-3.0, "-")])
def test_a_difference_has_the_digits_that_the_intervals_support(
    compared: Callable[..., tuple[Section, ...]], half_widths: float, shown: str
) -> None:
    _, first, _, difference, relative, *_ = row(compared(shifted("stiffness", half_widths)), "stiffness K")
    decimals = len(first.split(" ")[0].partition(".")[2])
    assert difference.startswith(shown)
    assert len(difference.partition(".")[2]) <= decimals
    assert (float(difference) == 0.0) is (relative == "0 %")
