"""A number that stands at the top of a module of the identifier says beside it what it is and where it comes from."""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted(path for path in (ROOT / "identify").rglob("*.py") if "__pycache__" not in path.parts)
TO_A_TOOL = ("fmt:", "noqa", "type:", "pragma:")  # comments that a tool reads


def comment_lines(text: str) -> tuple[set[int], set[int]]:
    """Lines with a comment for a reader: all, and those with nothing else."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    comments = [t for t in tokens if t.type == tokenize.COMMENT and not t.string.lstrip("# ").startswith(TO_A_TOOL)]
    return {t.start[0] for t in comments}, {t.start[0] for t in comments if t.line.lstrip().startswith("#")}


def is_numeric(value: ast.AST) -> bool:
    """Whether a number is written in it, or it is made of other constants alone."""
    if isinstance(value, ast.Subscript):  # an item of another constant
        return False
    if isinstance(value, ast.Constant):
        return type(value.value) in (int, float)
    return isinstance(value, ast.BinOp) or any(is_numeric(n) for n in ast.iter_child_nodes(value))


def unexplained(text: str) -> list[str]:
    """Numeric constants at the top of a module with no comment in their lines or in the one above."""
    (lines, alone), found = comment_lines(text), []
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None or not is_numeric(node.value):
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]
        beside = lines & set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        if not beside and node.lineno - 1 not in alone:
            found += [name for name in names if name.lstrip("_").isupper()]
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_numeric_constant_has_a_comment_with_its_unit_and_origin(path: Path) -> None:
    assert unexplained(path.read_text(encoding="utf-8")) == []


def test_a_bare_number_is_found_and_one_with_a_comment_is_not() -> None:
    text = "A = 3\n\nB = 2.0  # s: of a run\nE = 1\n# rad\nC = (1, 2)\n\nD = A**2  # noqa: X\nTEXT = 'x'\n"
    assert unexplained(text) == ["A", "E", "D"]
