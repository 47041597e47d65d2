"""Every malformed rig.yaml is refused with its place, its cause and its cure."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from rig.config.load import load_config
from rig.errors import ConfigError

RUNS = "backend: recorded\nrecorded:\n  runs:\n    - file: run1.csv\n"  # four lines
BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{chr(b)}: &{chr(b)} [{', '.join([f'*{chr(b - 1)}'] * 10)}]\n" for b in range(ord("b"), ord("j"))
)

# text of the file, then what its message has to say: place, cause, cure
CASES = {
    "no backend": ("recorded:\n  runs: [{file: a.csv}]\n", "backend", "required and missing", "add it"),
    "unknown backend": ("backend: simulatd\n", ":1: backend", "'simulatd'", "'simulated', 'bench' or 'recorded'"),
    "backend without section": ("backend: recorded\n", ":1: backend", "section `recorded:`", "add it"),
    "simulated without section": ("backend: simulated\n", ":1: backend", "section `simulated:`", "add it"),
    "empty backend section": ("backend: recorded\nrecorded:\n", ":2: recorded.runs", "missing", "add it"),
    "no runs": ("backend: recorded\nrecorded: {runs: []}\n", ":2: recorded.runs", "[]", "at least 1"),
    "unknown section": (RUNS + "identfy: {}\n", ":5: identfy", "unknown key", "did you mean 'identify'"),
    "unknown key": (RUNS + "identify:\n  sed: 3\n", ":6: identify.sed", "unknown key", "did you mean 'seed'"),
    "unknown key of a run": (
        RUNS + "      usee: fit\n",
        ":5: recorded.runs.0.usee",
        "unknown key",
        "did you mean 'use'",
    ),
    "wrong word": (RUNS + "      use: train\n", ":5: recorded.runs.0.use", "'train'", "'fit' or 'holdout'"),
    "text for a number": (RUNS + "      from_s: soon\n", ":5: recorded.runs.0.from_s", "'soon'", "a number"),
    "decimal comma": (RUNS + "      from_s: 0,5\n", ":5: recorded.runs.0.from_s", "'0,5'", "a number"),
    "sexagesimal time": (RUNS + "      from_s: 1:30\n", ":5: recorded.runs.0.from_s", "'1:30'", "a number"),
    "quoted number": (RUNS + '      from_s: "3"\n', ":5: recorded.runs.0.from_s", "'3'", "a number"),
    "true for a number": (RUNS + "      from_s: true\n", ":5: recorded.runs.0.from_s", "true", "a number"),
    "on for true": (RUNS + "identify: {genetic: {elitism: on}}", "elitism", "'on'", "true or false"),
    "number for text": ("backend: recorded\nrecorded: {runs: [{file: 7}]}", "runs.0.file", "7", "text"),
    "half an individual": (RUNS + "identify: {genetic: {population: 10.5}}", "population", "10.5", "whole number"),
    "probability of two": (
        RUNS + "identify: {genetic: {mutation_probability: 2}}",
        ":5: identify.genetic.mutation_probability",
        "2 is not allowed",
        "at most 1",
    ),
    "no inertia": (RUNS + "model: {inertia_kg_m2: 0}", ":5: model.inertia_kg_m2", "0 is not", "more than 0"),
    "NaN": (RUNS + "identify: {j_dec: .nan}", ":5: identify.j_dec", ".nan", "finite number"),
    "infinity": (RUNS + "identify: {lowpass_hz: .inf}", ":5: identify.lowpass_hz", ".inf", "finite number"),
    "overflow": (RUNS + "identify: {lowpass_hz: 1e999}", ":5: identify.lowpass_hz", "1e999", "finite number"),
    "endless integer": (RUNS + f"identify: {{seed: {'9' * 5000}}}", ":5: identify.seed", "9999", "number"),
    "whole number beyond all floats": (RUNS + f"identify: {{j_dec: {'9' * 400}}}", ":5: identify.j_dec", "9", "finite"),
    "brackets without end": ("a: " + "[{" * 60_000, "rig.yaml", "nested too deeply", "at most 40 levels"),
    "text turned around": (RUNS + 'name: "a\\u202eb"', ":5: name", "name of a folder", "letters"),
    "set turned around": (
        'backend: simulated\nsimulated: {}\nexcitation:\n  sets: [{torque_nm: 1, frequency_hz: 1, name: "\\u202ea"}]',
        ":4: excitation.sets.0.name",
        "reverses the text direction",
        "remove it",
    ),
    "set faster than its ticks": (
        "backend: simulated\nsimulated: {}\nexcitation:\n  sets: [{torque_nm: 1, frequency_hz: 1.0e+6}]",
        ":3: excitation",
        "1e+06 Hz cannot be played",
        "raise sample_rate_hz",
    ),
    "rest without end": (
        "backend: simulated\nsimulated: {}\nexcitation: {rest_s: 1.0e+9}",
        ":3: excitation.rest_s",
        "1000000000",
        "at most 3600",
    ),
    "set of a single sample": (
        "backend: simulated\nsimulated: {}\nexcitation:\n  sets: [{torque_nm: 1, frequency_hz: 1, duration_s: 0.001}]",
        ":3: excitation",
        "0.001 s are 1 samples at 1000 Hz",
        "at least 0.04 s",
    ),
    "platform too fast to simulate": (
        "backend: simulated\nsimulated: {platform: {inertia_kg_m2: 1.0e-9, stiffness_nm_rad: 1.0e+9}}",
        ":2: simulated",
        "1.59e+08 Hz",
        "raise inertia_kg_m2",
    ),
    "list for a mapping": (RUNS + "identify: [1, 2]", ":5: identify", "a list of 2", "mapping of keys"),
    "mapping for a list": (
        "backend: recorded\nrecorded: {runs: {file: a.csv}}",
        ":2: recorded.runs",
        "mapping",
        "a list",
    ),
    "term twice": (RUNS + "model: {terms: [inertia, inertia]}", ":5: model.terms", "twice", "once"),
    "no inertia term": (RUNS + "model: {terms: [damping]}", ":5: model.terms", "inertia is required", "leave out"),
    "unknown effect": (
        RUNS + "model:\n  effects:\n    coulomb_frictoin: {level_nm: 1}",
        ":7: model.effects.coulomb_frictoin",
        "unknown effect",
        "did you mean 'coulomb_friction'",
    ),
    "unknown candidate": (
        RUNS + "identify:\n  candidates:\n    - backlash\n    - stribek_friction",
        ":8: identify.candidates.1",
        "unknown effect",
        "did you mean 'stribeck_friction'",
    ),
    "candidate twice": (
        RUNS + "identify:\n  candidates:\n    - backlash\n    - backlash",
        ":8: identify.candidates.1",
        "'backlash'",
        "twice",
    ),
    "unknown effect parameter": (
        RUNS + "model:\n  effects:\n    coulomb_friction:\n      levle_nm: 1",
        ":8: model.effects.coulomb_friction.levle_nm",
        "unknown parameter",
        "did you mean 'level_nm'",
    ),
    "missing effect parameter": (
        RUNS + "model:\n  effects:\n    coulomb_friction: {}",
        ":7: model.effects.coulomb_friction",
        "level_nm is missing",
        "add it",
    ),
    "negative friction": (
        RUNS + "model:\n  effects:\n    coulomb_friction: {level_nm: -1}",
        ":7: model.effects.coulomb_friction.level_nm",
        "-1 is not allowed",
        "at least 0",
    ),
    "window backwards": (RUNS + "      from_s: 3\n      to_s: 2", ":4: recorded.runs.0", "to_s = 2", "later than"),
    "nothing to fit": (RUNS + "      use: holdout", "recorded", "there is nothing to fit", "set use: fit"),
    "zero scale": (RUNS + "  scale: {torque: 0}", ":5: recorded.scale.torque", "every value to 0", "converts to SI"),
    "column used twice": (
        RUNS + "  columns: {rate: a, angle: a}",
        ":5: recorded.columns",
        "two quantities",
        "its own",
    ),
    "address for a path": (
        "backend: recorded\nrecorded: {runs: [{file: 'https://a.b/c.csv'}]}",
        "runs.0.file",
        "an address, not a file",
        "download it first",
    ),
    "name with a path": (RUNS + "name: ../../etc", ":5: name", "name of a folder", "letters, digits"),
    "duplicate key": (RUNS + "name: a\nname: b", ":6: name", "given twice (first on line 5)", "keep one"),
    "bad indentation": ("backend: recorded\n recorded: 1", ":2:", "not YAML", "indentation"),
    "tab": ("backend: recorded\nrecorded:\n\truns: 1", ":3:", "not YAML", "spaces, never with tabs"),
    "unclosed bracket": ("backend: [recorded", ":1:", "not YAML", "brackets"),
    "glob for a path": ("backend: recorded\nrecorded: {runs: [{file: *.csv}]}", ":2:", "not YAML", "quotes"),
    "two documents": ("backend: recorded\n---\na: 1", "not YAML", "another document", "check"),
    "python tag": (RUNS + "name: !!python/object/apply:os.system [ls]", ":5: name", "tag", "plain mappings"),
    "binary tag": (RUNS + "name: !!binary aGk=", ":5: name", "tag", "plain value"),
    "merge key": ("x: &x {a: 1}\nbackend: recorded\nrecorded:\n  <<: *x", ":4: recorded", "merge keys", "write"),
    "list as a key": ("? [a, b]\n: 1\nbackend: recorded", ":1", "key has to be plain text", "not a list"),
    "alias bomb": (BOMB, ":", "expands to more than", "write the values out"),
    "alias inside itself": ("a: &a [*a]", ":1", "alias inside itself", "write the values out"),
    "deep nesting": ("a: " + "[" * 5000, "rig.yaml", "nested too deeply", "at most 40 levels"),
    "rather deep nesting": ("a: " + "[" * 60 + "]" * 60, ":1", "40 levels", "write the values out"),
    "not a mapping": ("- a\n- b", ":1", "mapping of keys", "backend: ..."),
    "only a comment": ("# nothing\n", ":1", "mapping of keys", "backend: ..."),
    "empty": ("", "rig.yaml", "is empty", "`backend:`"),
    "control character": ("backend: a\x07", "rig.yaml", "not YAML", "UTF-8"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_malformed_config_is_refused_with_cause_and_cure(tmp_path: Path, case: str) -> None:
    text, place, cause, cure = CASES[case]
    path = tmp_path / "rig.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_config(path)
    message = str(error.value)
    assert str(path) in message
    assert place in message.replace(str(tmp_path), "")
    assert cause in message
    assert cure in message
    assert error.value.exit_code == 2


def refusal(path: Path) -> str:
    with pytest.raises(ConfigError) as error:
        load_config(path)
    assert str(path) in str(error.value)
    return str(error.value)


def test_a_missing_file_says_where_it_looked(tmp_path: Path) -> None:
    assert "no such file: check the name and the folder you are in" in refusal(tmp_path / "gone.yaml")


def test_a_folder_is_no_config(tmp_path: Path) -> None:
    assert "is a folder: give the yaml file in it" in refusal(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_refused_instead_of_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    assert "not a regular file" in refusal(tmp_path / "pipe.yaml")


def test_bytes_that_are_no_text_are_named_by_line(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(b"backend: recorded\nname: \xff\xfe\n")
    message = refusal(path)
    assert ":2: byte 0xff is not UTF-8" in message
    assert "save the file as UTF-8" in message


def test_a_huge_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(b"# padding\n" * 100_000)
    message = refusal(path)
    assert "larger than" in message and "recorded.runs" in message


def test_long_strings_behind_aliases_do_not_fill_the_memory(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(f"a: &a {'x' * 100_000}\nb: [{', '.join(['*a'] * 5000)}]\n")
    began = time.perf_counter()
    assert "expands to more than" in refusal(path)
    assert time.perf_counter() - began < 5


def test_everything_wrong_is_said_at_once_in_the_order_of_the_lines(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(RUNS + "identify:\n  sed: 3\n  j_dec: -1\nmodel: {inertia_kg_m2: x}\nname: a\nname: b\n")
    lines = refusal(path).splitlines()
    assert [line.removeprefix(str(path)).split(":")[1] for line in lines] == ["6", "7", "8", "10"]


def test_a_long_list_of_faults_is_cut(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(RUNS + "".join(f"wrong{i}: 1\n" for i in range(100)))
    lines = refusal(path).splitlines()
    assert len(lines) == 26
    assert lines[-1] == "... and 75 more; correct these first"


def test_a_long_value_is_cut_in_the_message(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(RUNS + f"identify: {{seed: {'x' * 10_000}}}\n")
    assert len(refusal(path)) < 500


def test_a_wrong_run_is_not_also_reported_as_a_list_that_is_too_short(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(RUNS + "      usee: fit\n", encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_config(path)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("name", ["run.csv", "run.CSV", "run.npz", "recording.h5"])
def test_a_recording_in_the_place_of_a_configuration_is_told_how_to_get_one(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("time_s,torque_nm\n0,1\n")
    with pytest.raises(ConfigError, match=rf"is a recording.*`rig init .*{name}` writes one that reads it"):
        load_config(tmp_path / name)
