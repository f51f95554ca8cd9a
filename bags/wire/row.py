"""What a topic of a run is: one row of the table in `bags.wire.table`."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from bags.mcap.cdr import Layout
from bags.mcap.errors import BagError
from bags.mcap.topic import Topic, TopicKind
from dgu_sim.grid import Link

_RELATION = re.compile(r"\{(\w+)\}")

Codec_co = TypeVar("Codec_co", covariant=True)


class Over(Enum):
    """What there is one topic of a row for: the axis behind "steps" of its arrays."""

    RUN = "the run"
    DGUS = "each DGU i = j"
    MONITORS = "each DGU i = j that receives something"
    LINKS = "each link i to j"
    ANNOUNCING = "each DGU i = j that some member of the team does not hear"


class Need(Enum):
    """What the monitors of a run must do for a topic to be there."""

    ALWAYS = "always"
    LOCAL = "with monitor.local"
    INPUTS = "with monitor.plausibility"
    COMBINED = "when several tests draw one conclusion"
    TEAM = "with monitor.team"


class Widths(NamedTuple):
    """How many numbers the vectors of a run have.

    Attributes:
        outputs: p, of y.
        states: n, of x.
        inputs: m, of u: known inputs that travel with an output.
        applied: Of d: inputs that are unknown online.
        members: Of a team.
    """

    outputs: int
    states: int
    inputs: int = 0
    applied: int = 0
    members: int = 0

    @property
    def grid(self) -> int:
        """States of all members."""
        return self.states * self.members


Flat: TypeAlias = Callable[..., Sequence[Any]]
"""From a record to the numbers of its message behind the constants, vectors element by element."""

Made: TypeAlias = Callable[[Layout, int], Callable[[tuple[Any, ...]], Any]]
"""From a layout, and the number of links into the DGU, to the way back."""


class Form(NamedTuple):
    """How a record becomes the numbers of a fixed-length message, and comes back."""

    flat: Flat
    made: Made


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """A row at one place of a run: what a codec is made of.

    Attributes:
        topic: The topic.
        period_ns: T_s [ns].
        place: The link, or twice the DGU.
        frame: The header's frame_id.
        numbers: What never changes in the messages, in their order.
        sources: The DGUs that the one that listens receives from, ascending.
        form: Of a record in a fixed-length message.
    """

    topic: Topic
    period_ns: int
    place: Link
    frame: str
    numbers: tuple[int, ...]
    sources: tuple[int, ...]
    form: Form | None

    @property
    def layout(self) -> Layout:
        """Of messages of fixed length."""
        if self.topic.layout is None:
            raise BagError(f"{self.topic.name}: messages of {self.topic.type_name} vary in length")
        return self.topic.layout


@dataclass(frozen=True, slots=True, kw_only=True)
class Row(Generic[Codec_co]):
    """One row: the topics of one meaning, one for each place of an axis.

    Patterns have `{i}` for the watched or sending DGU and `{j}` for the one that listens; on an axis of DGUs they are
    the same.

    Attributes:
        key: Name of the row: field `f` of its messages is the array `key.f` of a run.
        name: Pattern of the topic's name.
        type_name: Full message type name.
        codec: Makes the codec of one topic.
        over: What there is one topic for.
        publisher: Pattern of the node that publishes it.
        says: What it says, in a few words.
        readers: Patterns of the nodes that read it besides the recorder; a word in braces other than i and j is a
            relation that the wiring of the run resolves: `monitor_{hearing}`.
        kind: Per step, event or latched.
        frame: Pattern of the header's frame_id.
        numbers: Fields that are the same in all messages of a topic, in their order: "i" or "j".
        sequences: What each sequence has as many elements of: an attribute of `Widths`.
        elsewhere: The array of each field that another row has already: `state.reference`.
        form: Of a record in a fixed-length message, None when messages vary in length.
        need: What must be for the topic to be there.
        listed: False: announced with its first message.
    """

    key: str
    name: str
    type_name: str
    codec: Callable[[Spot], Codec_co]
    over: Over
    publisher: str
    says: str
    readers: tuple[str, ...] = ()
    kind: TopicKind = TopicKind.PER_STEP
    frame: str = ""
    numbers: Mapping[str, str] = field(default_factory=dict)
    sequences: Mapping[str, str] = field(default_factory=dict)
    elsewhere: Mapping[str, str] = field(default_factory=dict)
    form: Form | None = None
    need: Need = Need.ALWAYS
    listed: bool = True

    def array(self, name: str) -> str:
        """The array of a run that a field belongs to."""
        return self.elsewhere.get(name, f"{self.key}.{name}")


def at(pattern: str, place: Link) -> str:
    """A pattern of the table at a link or DGU."""
    return pattern.replace("{i}", str(place.source)).replace("{j}", str(place.target))


def named(pattern: str, place: Link, related: Callable[[str, int], Sequence[int]]) -> tuple[str, ...]:
    """Names of the nodes that a pattern of readers means; `related` gives the DGUs in a relation to the place's."""
    name = at(pattern, place)
    found = _RELATION.search(name)
    if found is None:
        return (name,)
    return tuple(name.replace(found[0], str(dgu)) for dgu in related(found[1], place.source))
