"""A class is abstract or final: what it does stands in it, and none overrides what another one implements."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
_CODE = ("bags", "dcmg", "dgu_sim", "monitor", "ros_ws/src")


def _classes() -> Iterator[ast.ClassDef]:
    for folder in _CODE:
        for path in (ROOT / folder).rglob("*.py"):
            yield from (node for node in ast.walk(ast.parse(path.read_bytes())) if isinstance(node, ast.ClassDef))


def _methods(one: ast.ClassDef) -> set[str]:
    """Methods that do something, by their names."""
    return {
        node.name
        for node in one.body
        if isinstance(node, ast.FunctionDef) and len(node.body) > (ast.get_docstring(node) is not None)
    }


def test_no_class_overrides_what_another_implements() -> None:
    """A method that a base class of ours implements stands in no class below it."""
    known: defaultdict[str, list[ast.ClassDef]] = defaultdict(list)
    for one in _classes():
        known[one.name].append(one)
    overridden = {
        f"{one.name}.{name}"
        for one in (one for several in known.values() for one in several)
        for base in (ast.unparse(base).split("[")[0].split(".")[-1] for base in one.bases)
        for above in known.get(base, [])
        for name in _methods(above) & {node.name for node in one.body if isinstance(node, ast.FunctionDef)}
    }
    assert not overridden


def test_no_class_says_that_it_is_final() -> None:
    """All of them are: the word would stand above each."""
    marked = [one.name for one in _classes() for mark in one.decorator_list if ast.unparse(mark).endswith("final")]
    assert not marked
