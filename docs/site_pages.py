"""Pages of the site that are made when it is built (a hook of mkdocs): every public name, every key of every kind."""

# ruff: noqa: INP001 (a folder of pages, not a package)

import inspect
import json
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import dcmg
from dgu_sim.attacks import KINDS
from monitor.settings import MonitorSettings

_NAMES = """# Every name of the API

What `import dcmg` gives, from the docstrings: shapes, units, errors. [The Python API](api.md) shows each at work.
"""
_KEYS = """# Every key

Read from the models that check a scenario: section by section, then what the monitors are told, then each attack.
[Scenarios](scenario.md) explains how they belong together; `required` stands where there is no default.
"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what is generated."""
    names = "\n".join(_told(name) for name in dcmg.__all__)
    files.append(File.generated(config, "reference.md", content=f"{_NAMES}\n{names}"))
    files.append(File.generated(config, "keys.md", content=keys()))
    return files


def keys() -> str:
    """Tables of all keys of all models."""
    parts = [_KEYS]
    for model in (dcmg.Scenario, MonitorSettings):
        schema = model.model_json_schema()
        parts += [_section(schema), *(_section(one) for one in schema.get("$defs", {}).values() if "properties" in one)]
    parts += ["## Attacks\n", *(_section(one.model_json_schema(), f"Attack: {kind}") for kind, one in KINDS.items())]
    return "\n".join(parts)


def _told(name: str) -> str:
    """What mkdocstrings is to put there: a name, found where it is defined, called as users call it."""
    where = inspect.getmodule(getattr(dcmg, name))
    return f"::: {where.__name__}.{name}\n    options:\n      heading: dcmg.{name}\n      toc_label: {name}\n"


def _section(schema: dict[str, Any], title: str = "") -> str:
    required, rows = schema.get("required", []), []
    for key, told in schema.get("properties", {}).items():
        default = "required" if key in required else f"`{json.dumps(told['default'])}`" if "default" in told else ""
        rows.append(f"| `{key}` | {_cell(default)} | {_cell(told.get('description', ''))} |")
    about = inspect.cleandoc(schema.get("description", "")).split("\n\n")[0]
    table = "\n".join(["| key | default | meaning |", "|---|---|---|", *rows]) if rows else "No keys."
    return f"### {title or schema['title']}\n\n{about}\n\n{table}\n"


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").split())
