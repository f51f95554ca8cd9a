"""YAML in and out through the C library behind PyYAML where it is installed: ten times as fast."""

from typing import Any

import yaml

from dgu_sim.yaml_limits import load_within_limits

MOST_NODES = 200_000  # of a document in a bag: metadata.yaml has 40 for a topic
_Dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def dump(document: object) -> str:
    """A document of plain data, keys in their order."""
    return str(yaml.dump(document, Dumper=_Dumper, sort_keys=False, allow_unicode=True))


def load(text: str) -> Any:  # noqa: ANN401 - YAML holds whatever it holds
    """The plain data of a document.

    Raises:
        yaml.YAMLError: It is no YAML, or asks for too much.
    """
    return load_within_limits(text, most_nodes=MOST_NODES)
