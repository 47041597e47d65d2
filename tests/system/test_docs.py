"""The documentation: its paths and links exist, its commands run, its records have one form."""

from __future__ import annotations

import importlib
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import get_args, get_origin

import pytest
from pydantic import BaseModel

from rig.config.root import Config

ROOT = Path(__file__).parents[2]
TOPS = ("rig", "drivers", "identify", "sim_backend", "commands", "benchmarks")
TOUR = ROOT / "docs" / "how-a-campaign-flows.md"
DECISIONS = ROOT / "docs" / "decisions"
RECORDS = sorted(DECISIONS.glob("[0-9]*.md"))
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
WITH_COMMANDS = (*PAGES, *sorted((ROOT / "benchmarks").rglob("*.md")))
SECTIONS = ["Status", "Context", "Decision", "Consequences"]
MOST_WORDS = 450
PLAIN = {"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"}  # options in help neither coloured nor cut
HELP_WITHIN_S = 240.0  # all commands together; a busy machine takes seconds to import what one of them needs


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def packages() -> list[str]:
    """Every folder with modules in it, as `identify/select`."""
    folders = {p.parent for top in TOPS for p in (ROOT / top).rglob("*.py") if "__pycache__" not in p.parts}
    return sorted(name_of(folder) for folder in folders)


def named_in_code_marks(path: Path) -> set[str]:
    return {match.strip("/") for match in re.findall(r"`([^`\n]+)`", text_of(path))}


def paths_in(path: Path) -> list[str]:
    """Names in code marks that are a path from the root; `rig/effects/<name>.py` is a pattern and no path."""
    first = (*TOPS, "docs", "tests", "examples")
    found = (n for n in named_in_code_marks(path) if "/" in n and n.split("/")[0] in first)
    return sorted(n for n in found if not set("<>{} *") & set(n))


@cache
def anchors(page: Path) -> set[str]:
    """What the headings of a page are called in links, as code hosts make them."""
    out: set[str] = set()
    for heading in re.findall(r"^#+ +(.+)$", text_of(page), re.M):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower().replace("`", "")
        out.add(re.sub(r"[^\w\- ]", "", words).strip().replace(" ", "-"))
    return out


def links() -> list[tuple[Path, str]]:
    found = []
    for page in PAGES:
        prose = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.M | re.S)
        found += [(page, target) for target in re.findall(r"\]\(([^)\s]+)\)", prose)]
    return [(page, target) for page, target in found if not re.match(r"[a-z]+:", target)]


PROGRAM = re.compile(
    r"(?:(?:^|bin/)(identify-(?:run|batch)(?=\s|$)|rig [a-z]+\b)"
    r"|\bpython3? (-m benchmarks[\w.]+\w|benchmarks/[\w/]+\.py))(.*)"
)


def documented_commands() -> dict[str, set[str]]:
    """Every command in the pages, cut down to what answers --help, with the options that the pages give it."""
    found: dict[str, set[str]] = {}
    for page in WITH_COMMANDS:
        text = text_of(page)
        blocks = [line for block in re.findall(r"^```sh\n(.*?)^```$", text, re.M | re.S) for line in block.splitlines()]
        indented, marked = re.findall(r"^ {4}(\S.*)$", text, re.M), re.findall(r"`([^`\n]+)`", text)
        for line in "&&".join((*blocks, *indented, *marked)).split("&&"):
            if match := PROGRAM.search(line.strip()):
                program, script, rest = match.groups()
                command = program or f"python {script}"
                found.setdefault(command, set()).update(re.findall(r"--[a-z][\w-]*", rest))
    return found


def benchmarks() -> dict[str, set[str]]:
    """Every benchmark that can be started, documented on a page or in its own first lines only."""
    programs = (p for p in sorted((ROOT / "benchmarks").rglob("*.py")) if '__name__ == "__main__"' in text_of(p))
    return {f"python -m {name_of(p).removesuffix('.py').replace('/', '.')}": set() for p in programs}


def as_started(command: str) -> list[str]:
    """The words of a command, the name of an installed one replaced by its entry point."""
    program, *rest = shlex.split(command)
    return [program if program == "python" else scripts()[program], *rest]


def scripts() -> dict[str, str]:
    """Program -> entry point, as `pyproject.toml` declares them."""
    section = text_of(ROOT / "pyproject.toml").split("[project.scripts]")[1].split("\n[")[0]
    return dict(re.findall(r'^([\w-]+) = "([^"]+)"', section, re.M))


@pytest.mark.parametrize("package", packages())
def test_the_tour_names_every_package(package: str) -> None:
    assert package in named_in_code_marks(TOUR), f"add a line for {package} to {name_of(TOUR)}"


@pytest.mark.parametrize("path", paths_in(TOUR))
def test_every_path_in_the_tour_exists(path: str) -> None:
    assert (ROOT / path).exists(), f"{name_of(TOUR)} names {path}, which has moved or is gone"


@pytest.mark.parametrize("page", [p for p in PAGES if p != TOUR], ids=name_of)
def test_every_path_on_a_page_exists(page: Path) -> None:
    made = re.compile(r"drivers/gyroscopes/hashgyro\.py")  # the worked example of a new driver
    gone = [path for path in paths_in(page) if not (ROOT / path).exists() and not made.fullmatch(path)]
    assert not gone, f"{name_of(page)} names what has moved or is gone: {', '.join(gone)}"


def names_in_files(page: Path) -> list[tuple[str, str]]:
    """Name and file of "`CHECKS` in `rig/guard/guard.py`", "`a`, `b` in `x.py`" and "`x.py` (`name`)"."""
    text, name = text_of(page), r"`\w+`"
    before = re.findall(rf"((?:{name}(?:, | and ))*{name}) in `([\w/]+/\w+\.py)`", text)
    behind = re.findall(rf"`([\w/]+/\w+\.py)` \(((?:{name}(?:, | and ))*{name})", text)
    pairs = [*before, *((names, path) for path, names in behind)]
    return [(n, path) for names, path in pairs for n in re.findall(r"`(\w+)`", names)]


def test_names_said_to_be_in_a_file_are_found_on_a_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("a line in `A` in `rig/x.py`; `b`, `c` in `rig/y.py`, `rig/z.py` (`_d`)", encoding="utf-8")
    found = [("A", "rig/x.py"), ("b", "rig/y.py"), ("c", "rig/y.py"), ("_d", "rig/z.py")]
    assert names_in_files(page) == found


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=name_of)
def test_every_name_that_a_page_puts_in_a_file_is_there(page: Path) -> None:
    gone = [f"{n} in {path}" for n, path in names_in_files(page) if not re.search(rf"\b{n}\b", text_of(ROOT / path))]
    assert not gone, f"{name_of(page)} looks in the wrong file for {', '.join(gone)}"


def types_in(annotation: object) -> list[object]:
    """The type of a key, or all those inside a union, a list or a mapping."""
    return [annotation, *(found for inner in get_args(annotation) for found in types_in(inner))]


def is_key(dotted: str) -> bool:
    """Whether rig.yaml has such a key; below a mapping whose keys the user chooses anything may stand."""
    within: list[object] = [Config]
    for part in dotted.split("."):
        sections = [t for t in within if isinstance(t, type) and issubclass(t, BaseModel)]
        holders = [section for section in sections if part in section.model_fields]
        if not holders:
            return any(get_origin(t) is Mapping for t in within)
        within = [t for holder in holders for t in types_in(holder.model_fields[part].annotation)]
    return True


def test_keys_are_told_from_what_is_none() -> None:
    assert is_key("identify.follow_up") and is_key("bench.amplifier.watchdog_ms") and is_key("model.effects.own.level")
    assert not is_key("identify.follow_up.planner") and not is_key("identify.candidate")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_key_of_rig_yaml_on_a_page_exists(page: Path) -> None:
    keys = {
        n for n in named_in_code_marks(page) if re.fullmatch(rf"(?:{'|'.join(Config.model_fields)})(?:\.[a-z_]+)+", n)
    }
    files = {n for n in keys if n.endswith((".py", ".yaml", ".html"))}
    unknown = sorted(n for n in keys - files if not is_key(n))
    assert not unknown, f"{name_of(page)} names keys that rig.yaml has not: {', '.join(unknown)}"


@pytest.mark.parametrize("record", RECORDS, ids=lambda path: path.name)
def test_a_decision_record_has_its_four_sections_and_fits_a_page(record: Path) -> None:
    assert re.findall(r"^## (.+)$", text_of(record), re.M) == SECTIONS
    assert len(text_of(record).split()) <= MOST_WORDS


def test_the_index_lists_every_decision_record_by_its_title() -> None:
    index = text_of(DECISIONS / "README.md")
    for record in RECORDS:
        number, title = re.findall(r"^# (\d+)\. (.+)$", text_of(record), re.M)[0]
        assert int(number) == int(record.name[:4])
        assert f"| [{number}]({record.name}) | {title} |" in index


@pytest.mark.parametrize(("page", "target"), links(), ids=lambda v: v if isinstance(v, str) else name_of(v))
def test_every_link_leads_somewhere(page: Path, target: str) -> None:
    file, _, anchor = target.partition("#")
    leads_to = (page.parent / file).resolve() if file else page
    assert leads_to.exists(), f"{name_of(page)} links {target}"
    if anchor:
        assert anchor in anchors(leads_to), f"{name_of(page)} links {target}: no such heading"


def test_every_command_answers_help_and_has_its_documented_options() -> None:
    commands = {**benchmarks(), **documented_commands()}
    lines = [[*as_started(command), "--help"] for command in commands]
    done = subprocess.run(
        [sys.executable, "-m", "tests.system.helps"], input=json.dumps(lines), check=True, cwd=ROOT,
        stdout=subprocess.PIPE, text=True, env={**os.environ, **PLAIN}, timeout=HELP_WITHIN_S,
    )  # fmt: skip
    wrong = []
    for (command, options), (code, out, err) in zip(commands.items(), json.loads(done.stdout), strict=True):
        unknown = sorted(options - set(re.findall(r"--[a-z][\w-]*", out)))
        if code != 0 or "usage" not in out.lower():
            wrong.append(f"{command} --help: exit code {code}, {err.strip() or out.strip()!r}")
        if unknown:
            wrong.append(f"{command} has no {', '.join(unknown)}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("command", ["python -m benchmarks.peers", "identify-run", "identify-batch"])
def test_a_command_starts_in_a_process_of_its_own(command: str) -> None:
    program, *rest = as_started(command)
    module, _, function = program.partition(":")
    starts = rest if program == "python" else ["-c", f"from {module} import {function}; {function}()"]
    done = subprocess.run(
        [sys.executable, *starts, "--help"], check=False, cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, **PLAIN}, timeout=HELP_WITHIN_S, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "usage" in done.stdout.lower()


def test_all_programs_and_the_benchmarks_are_documented_and_benchmarks_as_modules() -> None:
    commands = documented_commands()
    assert {"identify-run", "identify-batch", "rig check", "rig play"} <= set(commands)
    assert any(command.startswith("python -m benchmarks.") for command in commands)
    assert not any(command.startswith("python benchmarks/") for command in commands)
    own = [name_of(p) for p in (ROOT / "benchmarks").rglob("*.py") if "python benchmarks/" in text_of(p)]
    assert not own, f"write `python -m benchmarks.NAME` in {', '.join(own)}"


@pytest.mark.parametrize("package", ["identify", "rig"])
def test_every_public_name_is_explained_in_the_docs_and_where_it_is_defined(package: str) -> None:
    table = text_of(ROOT / "docs" / "from-python.md").partition("## All public names")[2]
    module = importlib.import_module(package)
    listed = set(re.findall(rf"`{package}\.(\w+)", table))
    assert set(module.__all__) <= listed
    assert [name for name in module.__all__ if not (getattr(module, name).__doc__ or "").strip()] == []
