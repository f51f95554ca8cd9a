"""No import hides from the contracts in pyproject.toml."""

import ast
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = ("bags", "dgu_sim", "monitor")


def _named_modules(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.partition(".")[0] in ROOMS:
            parts = node.value.split(".")
            if len(parts) > 1 and all(part.isidentifier() for part in parts) and _exists(node.value):
                yield node.value


def _exists(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def test_modules_are_imported_by_statements_that_the_contracts_see() -> None:
    """No module of a room is named in a text that `import_module` could take, but by the rooms' lazy front doors."""
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for room in ROOMS
        for path in sorted((ROOT / room).rglob("*.py"))
        if path.relative_to(ROOT).parts[1:] != ("__init__.py",)
        for name in _named_modules(ast.parse(path.read_text(encoding="utf-8")))
        if not ".".join(path.relative_to(ROOT).parts).startswith(f"{name}.")  # its own folder, to read data from
    ]
    assert found == []
