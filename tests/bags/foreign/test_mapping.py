"""Mapping files: wrong ones are one line, and the page names every key."""

import json
import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from bags.foreign import mapping as module
from bags.foreign.mapping import load_mapping, mapping_of
from bags.mcap.errors import BagError

ROOT = Path(__file__).parents[3]
SECTIONS: dict[str, type[BaseModel]] = {
    "Top level": module.Mapping,
    "sampling": module.SamplingSettings,
    "histories": module.HistoryMapping,
    "streams": module.StreamMapping,
    "A signal": module.Signal,
}


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("stream: []", r"stream = \[\]: no such key: did you mean streams\?"),
        ("sampling: {policy: guess}", "sampling.policy = 'guess': expected 'refuse', 'nearest', 'hold' or 'linear'"),
        ("sampling: {tolerance: 0.6}", "sampling.tolerance = 0.6: expected a number less than 0.5"),
        ("sampling_period_sec: -1", "sampling_period_sec = -1: expected a number greater than 0"),
        ("histories: [{dgu: 0, y: [/a.b]}]", "histories.0.dgu = 0: expected a number greater than or equal to 1"),
        ("histories: [{dgu: 1}]", "histories.0.y: this key is missing"),
        ("histories: [{dgu: 1, y: []}]", r"histories.0.y = \[\]: expected at least 1 entries"),
        ("histories: [{dgu: 1, y: [{unit: V}]}]", "histories.0.y.0.field: this key is missing"),
        ("histories: [{dgu: 1, y: [{field: /a.b, unit: ft}]}]", "histories.0.y.0.unit = 'ft': expected one of V, A"),
        ("streams: [{link: 1-1, y: [/a.b]}]", "streams.0.link = '1-1': expected two different DGU numbers, as in 1-2"),
        (
            "streams: [{link: 1-2, y: [/a.b]}, {link: 1-2, y: [/a.c]}]",
            "streams.1.link = '1-2': expected each link once",
        ),
        ("monitor: {observer: {sort: x}}", "monitor.observer.sort = 'x': no such key"),
        ("- 1", r"expected a mapping of keys, found \[1\]"),
        ("a: [", "line 2, column 1: expected YAML"),
    ],
)
def test_wrong_mappings_are_one_line(tmp_path: Path, text: str, what: str) -> None:
    """File, key, value and what was expected."""
    file = tmp_path / "mapping.yaml"
    file.write_text(text)
    with pytest.raises(BagError, match=what) as error:
        load_mapping(file)
    assert str(error.value).startswith(str(file))
    assert "\n" not in str(error.value)


def test_short_forms() -> None:
    """A text is a field, with its factor behind a star."""
    (entry,) = mapping_of({"histories": [{"dgu": 1, "y": ["/a.b", "c*0.001", "d*e"]}]}, "test").histories
    assert [(one.field, one.factor) for one in entry.y] == [("/a.b", 1.0), ("c", 0.001), ("d*e", 1.0)]
    assert entry.tables["x"] == entry.y


@pytest.mark.parametrize("heading", SECTIONS)
def test_every_key_stands_on_the_page(heading: str) -> None:
    """The page and the models agree on keys, defaults and what they mean."""
    page = (ROOT / "docs" / "import.md").read_text(encoding="utf-8")
    section = re.split(rf"^#+ {re.escape(heading)}$", page, flags=re.MULTILINE)[1]
    section = re.split(r"^#+ ", section, flags=re.MULTILINE)[0]
    rows = {
        key: (default, text)
        for key, default, text in re.findall(r"^\| `(\w+)` \| ([^|]+) \| (.+) \|$", section, flags=re.MULTILINE)
    }
    expected = {}
    for key, field in SECTIONS[heading].model_fields.items():
        if field.is_required():
            default = "required"
        elif field.default_factory is not None:
            default = "see below"
        elif field.default is None or field.default == ():
            default = "none"
        else:
            value = getattr(field.default, "value", field.default)
            default = f"`{value}`" if isinstance(value, str) else f"`{json.dumps(value)}`"
        expected[key] = (default, field.description)
    assert rows == expected
