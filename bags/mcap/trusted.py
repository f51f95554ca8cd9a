"""Whether definitions in a damaged file are what they were: held against every other place that says the same.

A channel and a schema stand in front of the chunks without a check sum of their own. Their copies are the summary (gone
with the end of the file), metadata.yaml, the type hash in the channel, and for standard types our own type store.
"""

import re
from collections.abc import Mapping
from typing import Any

from mcap.records import Channel, Schema

from bags.mcap.definitions import CDR, Definition, decoder_of, is_standard
from bags.mcap.errors import BagError
from bags.mcap.typestore import schema_text, type_hash, typestore

_TYPE = re.compile(r"[A-Za-z]\w*(/[A-Za-z]\w*)?/[A-Za-z]\w*")
_SIMILAR = 2  # letters that a damaged name may differ in from a known one


def told_types(information: Mapping[str, Any]) -> dict[str, str]:
    """Type of each topic as metadata.yaml says, {} when it says nothing."""
    found: dict[str, str] = {}
    entries = information.get("topics_with_message_count")
    for one in entries if isinstance(entries, list) else ():
        about = one.get("topic_metadata") if isinstance(one, dict) else None
        if isinstance(about, dict):
            found[str(about.get("name"))] = str(about.get("type"))
    return found


def verified_schema(schema: Schema) -> tuple[Schema, str]:
    """A schema as it must have been, and in words what was wrong with it, "" for nothing.

    A definition of a standard type that differs from it in a letter or two is that type; comments may differ.
    """
    if schema.encoding not in {"ros2msg", ""} and not _close(schema.encoding, "ros2msg"):
        return schema, ""
    name = schema.name if schema.name in typestore().fielddefs else _nearest(schema.name)
    if name is None:
        return schema, ""
    definition = Definition(type_name=schema.name, form=schema.encoding, text=schema.data.decode("utf-8", "replace"))
    wanted = schema_text(name).encode()
    same = is_standard(definition) and _bare(wanted) == _bare(schema.data)
    if name == schema.name and schema.encoding == "ros2msg" and same and not _odd(schema.data):
        return schema, ""
    words, found = _bare(wanted), _bare(schema.data)
    if words != found and sorted(words) == sorted(found):
        return schema, ""  # the same fields in another order: no damage does that
    if len(wanted) != len(schema.data) or sum(a != b for a, b in zip(wanted, schema.data, strict=True)) > _SIMILAR:
        return schema, ""
    mended = Schema(id=schema.id, name=name, encoding="ros2msg", data=wanted)
    return mended, f"the definition of {name} is damaged: the known one was taken"


def channel_fault(channel: Channel, schema: Schema | None, told: Mapping[str, str]) -> str:
    """Why a channel cannot be trusted, "" when nothing speaks against it."""
    what = f"the channel of {channel.topic!r:.80} is damaged"
    if channel.message_encoding != CDR and _close(channel.message_encoding, CDR):
        return f"{what}: encoding {channel.message_encoding!r}"
    if not channel.topic or any(not one.isprintable() for one in channel.topic):
        return f"{what}: its topic"
    if told and channel.topic not in told:
        return f"{what}: metadata.yaml knows no such topic"
    return _fault_with_schema(channel, schema, told) if schema else ""


def _fault_with_schema(channel: Channel, schema: Schema, told: Mapping[str, str]) -> str:
    if told and told[channel.topic] != schema.name:
        return f"the channel of {channel.topic} is of {schema.name!r:.80}, metadata.yaml says {told[channel.topic]}"
    form = schema.encoding
    if form not in {"", "ros2msg"} and (form in "ros2msg" or form.startswith("ros2msg")):  # its length is wrong
        return f"the definition of {channel.topic} is damaged: it is written as {form!r:.80}"
    if schema.encoding != "ros2msg" or channel.message_encoding != CDR:
        return ""  # of another program: nothing to hold it against
    return _schema_fault(channel, schema)


def _schema_fault(channel: Channel, schema: Schema) -> str:
    """Whether the definition parses, and has the hash that the channel states."""
    definition = Definition(type_name=schema.name, form="ros2msg", text=schema.data.decode("utf-8", "replace"))
    stated = channel.metadata.get("topic_type_hash", "")
    if not _TYPE.fullmatch(schema.name):
        return f"the definition of {channel.topic} is damaged: its type is called {schema.name!r:.80}"
    try:
        decoder_of(definition)
    except BagError as error:
        known = schema.name.partition("/")[2].partition("/")[0] in {"srv", "action"}  # service events parse nowhere
        return "" if known else f"the definition of {channel.topic} is damaged: {error}"
    if stated.startswith("RIHS01_") and schema.name in typestore().fielddefs and is_standard(definition):
        return "" if type_hash(schema.name) == stated else f"the channel of {channel.topic} states another type hash"
    return ""


def _bare(text: bytes) -> list[bytes]:
    """The words of a definition without its comments: a default value is none of the fields, and may be damaged."""
    return re.sub(rb"#[^\n]*", b"", text).split()


def _odd(data: bytes) -> bool:
    """Whether bytes are no text."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        return True
    return any(not one.isprintable() and one not in "\n\t\r" for one in text)


def _nearest(name: str) -> str | None:
    return next((one for one in typestore().fielddefs if _close(one, name)), None)


def _close(one: str, other: str) -> bool:
    """Whether two texts of one length differ in a letter or two."""
    return len(one) == len(other) and 0 < sum(a != b for a, b in zip(one, other, strict=True)) <= _SIMILAR
