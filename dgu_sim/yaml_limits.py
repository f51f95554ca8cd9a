"""What a YAML text may ask of whoever reads it: a file of 500 bytes can stand for gigabytes, or end the process."""

from contextlib import suppress
from typing import Any, Final

import yaml

try:
    from yaml import CSafeLoader as SafeLoader  # ten times as fast
except ImportError:
    from yaml import SafeLoader  # type: ignore[assignment]

__all__ = ["MOST_DEPTH", "MOST_NODES", "SafeLoader", "YamlLimitError", "check_limits", "load_within_limits"]

MOST_BYTES: Final = 16_000_000
MOST_DEPTH: Final = 64
MOST_NODES: Final = 2_000_000


class YamlLimitError(yaml.YAMLError):
    """A text asks for more than it may."""


def load_within_limits(text: str, loader: type[SafeLoader] = SafeLoader, *, most_nodes: int = MOST_NODES) -> Any:  # noqa: ANN401 - YAML holds whatever it holds
    """The plain data of a text.

    Args:
        text: One YAML document.
        loader: A safe one.
        most_nodes: As for `check_limits`.

    Raises:
        yaml.YAMLError: It is no YAML, or asks for too much.
    """
    check_limits(text, most_nodes=most_nodes)
    try:
        return yaml.load(text, Loader=loader)  # noqa: S506 - a safe loader
    except RecursionError:  # of the loader in Python, where the one in C is missing
        raise YamlLimitError(f"nested more than {MOST_DEPTH} deep") from None
    except (ValueError, OverflowError) as error:  # a number of too many digits, the 45th of a month
        raise YamlLimitError(f"holds what only looks like a number or a date ({error})") from None


def check_limits(text: str, *, most_nodes: int = MOST_NODES) -> None:
    """Go through the events of a text, which costs a tenth of building it, and none of what aliases stand for.

    What is no YAML passes as far as it goes: whoever builds it will say where it ends.

    Args:
        text: One YAML document.
        most_nodes: Scalars, sequences and mappings in it, each alias counted as everything that it stands for.

    Raises:
        YamlLimitError: It is too large, too deep, or stands for too much.
    """
    if len(text) > MOST_BYTES:
        raise YamlLimitError(f"{len(text)} characters, expected at most {MOST_BYTES}")
    with suppress(yaml.MarkedYAMLError, yaml.reader.ReaderError):
        _count(text, most_nodes)


def _count(text: str, most_nodes: int) -> None:
    sizes: dict[str | None, int] = {}  # of each anchor, everything inside counted
    open_nodes: list[tuple[str | None, int]] = []  # anchor of each open node, and how many nodes stood before it
    total = 0
    for event in yaml.parse(text, Loader=SafeLoader):
        match event:
            case yaml.AliasEvent():
                total += sizes.get(event.anchor, 1)
            case yaml.ScalarEvent():
                total += 1
                sizes[event.anchor] = 1
            case yaml.MappingStartEvent() | yaml.SequenceStartEvent():
                open_nodes.append((event.anchor, total))
                total += 1
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                anchor, before = open_nodes.pop()
                sizes[anchor] = total - before
        if len(open_nodes) > MOST_DEPTH:
            raise YamlLimitError(f"nested more than {MOST_DEPTH} deep")
        if total > most_nodes:
            raise YamlLimitError(f"stands for more than {most_nodes} values (aliases counted), expected fewer")
