"""A name that is a number at the top of one module is no other number, and nothing else, at the top of another."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("commands", "drivers", "identify", "rig", "sim_backend")
KNOWN = {"__builtins__": {}, "math": math, "int": int, "float": float, "range": range}  # to arithmetic


def is_numeric(value: object) -> bool:
    if isinstance(value, tuple | range):
        return len(value) > 0 and all(is_numeric(v) for v in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def value_of(node: ast.expr, before: Mapping[str, object]) -> object:
    """What arithmetic comes to with the constants before it; its text where it needs imported ones; None: no number."""
    if any(isinstance(n, ast.Constant) and type(n.value) not in (int, float) for n in ast.walk(node)):
        return None
    try:
        value = eval(compile(ast.Expression(node), "", "eval"), dict(KNOWN), dict(before))
    except (NameError, TypeError):
        return ast.unparse(node) if isinstance(node, ast.BinOp) else None
    return tuple(value) if is_numeric(value) and isinstance(value, range) else value if is_numeric(value) else None


def constants(text: str) -> Iterator[tuple[str, object]]:
    """Each capital name at the top of a module with its number, or None; names that are given a tuple one by one."""
    before: dict[str, object] = {}
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            value = value_of(node.value, before)
            pairs = [(target, value)]
            if isinstance(target, ast.Tuple):
                parts = list(value) if isinstance(value, tuple) else [None] * len(target.elts)
                if isinstance(node.value, ast.Tuple):  # some of them may be no numbers
                    parts = [value_of(element, before) for element in node.value.elts]
                pairs = list(zip(target.elts, parts, strict=True))
            for name, number in pairs:
                if isinstance(name, ast.Name) and name.id.isupper():
                    before |= {name.id: number} if is_numeric(number) else {}
                    yield name.id, number


def clashes(modules: Mapping[str, str]) -> list[str]:
    """Of modules by path and text: every name that is a number in one and anything else in another, with both."""
    found, first = [], dict[str, tuple[str, object]]()
    for path, text in modules.items():
        for name, value in constants(text):
            where, other = first.setdefault(name, (path, value))
            if where != path and other != value:
                one, two = ("no number" if v is None else v for v in (other, value))
                found.append(f"{name} is {one} in {where} and {two} in {path}")
    return found


def test_no_two_modules_give_one_name_to_different_numbers() -> None:
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    found = clashes({path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths})
    assert not found, "give each a name of its own that says what it is:\n" + "\n".join(found)


def test_a_name_with_two_numbers_is_found_with_both_files_and_a_copy_or_a_text_is_not() -> None:
    modules = {
        "a.py": "N = 3\nM, HALF = 1 << 4, 0.5\nTWICE = 2 * HALF\nA, B = range(2)\nSAME: float = 2\nT = 'x'\nW = 64 * X",
        "b.py": "N = 4\nM, HALF = 16, 'half'\nTWICE = 1.0\nB = 0\nSAME = 2.0\nT = Path('y')\nW = 3\n",
    }
    assert clashes(modules) == [
        "N is 3 in a.py and 4 in b.py",
        "HALF is 0.5 in a.py and no number in b.py",
        "B is 1 in a.py and 0 in b.py",
        "W is 64 * X in a.py and 3 in b.py",
    ]
