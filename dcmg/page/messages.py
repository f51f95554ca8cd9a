"""Everything that the page's server and a browser say to each other; `schema()` is what the browser checks against."""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

__all__ = ["ClientMessage", "ServerMessage", "parse_client", "schema"]

Word: TypeAlias = Annotated[str, Field(max_length=80)]
Number: TypeAlias = Annotated[float, Field(allow_inf_nan=False)]
Values: TypeAlias = list[float | None]  # None: there is no number


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


# from a browser


class View(_Message):
    """What a browser shows, and so wants to be told.

    Attributes:
        panels: voltage, current, alpha, heat, or a link, as 1-2.
        span_sec: Length of the time axis [s].
        pixels: Width of a plot: no more columns than these are sent.
    """

    kind: Literal["view"] = "view"
    panels: Annotated[list[Word], Field(max_length=40)]
    span_sec: Annotated[Number, Field(gt=0, le=86_400)]
    pixels: Annotated[int, Field(ge=50, le=4000)]


class Hello(_Message):
    """The first message of a browser.

    Attributes:
        secret: What the page was delivered with: no other site knows it.
        view: What it shows.
    """

    kind: Literal["hello"] = "hello"
    secret: Annotated[str, Field(max_length=200)]
    view: View


class _Command(_Message):
    """Something to be done; the reply carries its id."""

    id: Annotated[int, Field(ge=0, le=2**53)]


class Clock(_Command):
    """Time: go on, stand still, make some steps, or another rate (1: as fast as the wall clock)."""

    kind: Literal["clock"] = "clock"
    action: Literal["resume", "pause", "step", "rate"]
    steps: Annotated[int, Field(ge=1, le=100_000)] = 1
    rate: Annotated[Number, Field(ge=0.01, le=1000)] = 1.0


class Seek(_Command):
    """Go to a step of a recorded run."""

    kind: Literal["seek"] = "seek"
    step: Annotated[int, Field(ge=0, le=2**53)]


class Attack(_Command):
    """An attack by hand: check what is typed, start, change what is active on its first link, stop.

    Attributes:
        links: The attacked links, as 1-2; the first one is what `change` and `stop` mean.
        attack: Kind of attack.
        parameters: As typed.
        duration_sec: Length [s], 0: until stopped.
    """

    kind: Literal["attack"] = "attack"
    action: Literal["check", "start", "change", "stop"]
    links: Annotated[list[Word], Field(min_length=1, max_length=200)]
    attack: Word = ""
    parameters: dict[Word, Annotated[str, Field(max_length=4000)]] = {}
    duration_sec: Annotated[Number, Field(ge=0, le=1e6)] = 0.0
    anyway: bool = False


class Cut(_Command):
    """A defender's: let secondary control leave a link out, or take it in again."""

    kind: Literal["cut"] = "cut"
    link: Word
    on: bool


class Again(_Command):
    """Play the challenge again."""

    kind: Literal["again"] = "again"


class WhatIf(_Command):
    """Play an attack ahead from the moment that is shown; nothing of what is shown changes.

    Attributes:
        worst: The largest damage that no observer of a link sees, whatever the rest of this says.
    """

    kind: Literal["whatif"] = "whatif"
    worst: bool = False
    links: Annotated[list[Word], Field(min_length=1, max_length=200)]
    attack: Word = ""
    parameters: dict[Word, Annotated[str, Field(max_length=4000)]] = {}
    horizon_sec: Annotated[Number, Field(gt=0, le=120)] = 10.0


ClientMessage: TypeAlias = Annotated[
    Hello | View | Clock | Seek | Attack | WhatIf | Cut | Again, Field(discriminator="kind")
]


# from the server


class Parameter(_Message):
    """A parameter of a kind of attack."""

    name: str
    means: str
    default: str
    example: str
    required: bool


class AttackKind(_Message):
    """A kind of attack."""

    name: str
    does: str
    knows: str
    links: list[str]  # an example: how many it wants
    parameters: list[Parameter]


class Dgu(_Message):
    """A DGU; x and y, from 0 to 1, say where it is drawn."""

    number: int
    facts: str
    x: float
    y: float


class Line(_Message):
    """A power line."""

    between: tuple[int, int]
    facts: str


class LinkFacts(_Message):
    """A directed communication link; `certificate` says what its observer can and cannot see."""

    name: str
    source: int
    target: int
    monitored: bool
    certificate: list[str]


class Outline(_Message):
    """What does not change while the page is open.

    Attributes:
        source: What is shown.
        about: Its description.
        end_step: Its length in steps; None: it goes on.
        outputs: Names of what residuals are of, with units.
        bag: Where it is recorded, None: nowhere.
        can: What can be done to it: clock, seek, attack, whatif, cut.
        challenge: The goal, if this is a game.
    """

    kind: Literal["outline"] = "outline"
    name: str
    source: Literal["simulation", "bag", "ros"]
    about: str
    sampling_period_sec: float
    end_step: int | None
    outputs: list[str]
    bag: str | None
    can: list[str]
    challenge: str | None
    dgus: list[Dgu]
    lines: list[Line]
    links: list[LinkFacts]
    attacks: list[AttackKind]


class LinkState(_Message):
    """A link at a moment: what its monitor says, and whether it is attacked.

    Attributes:
        state: What the monitor says; hidden from an attacker who does not see it.
        score: The largest |r_i| / threshold_i.
    """

    state: Literal["refused", "settling", "calibrating", "quiet", "suspicious", "alarm", "hidden"]
    attacked: bool
    score: float | None


class Time(_Message):
    """The clock of what is shown.

    Attributes:
        factor: Simulated time over wall time, measured over the last second or so.
        late: Steps that were made later than their time, since the start.
    """

    step: int
    first_step: int
    running: bool
    ended: bool
    rate: float
    factor: float | None
    late: int


class Series(_Message):
    """Columns of a panel: the smallest and the largest value of `bin_steps` steps each, from bin `first_bin` on.

    Attributes:
        anew: Nothing of what was sent before fits.
        high: Missing where a bin is one step.
    """

    panel: str
    anew: bool
    bin_steps: int
    first_bin: int
    low: list[Values]
    high: list[Values] | None


class Entry(_Message):
    """A line of the log."""

    number: int
    step: int
    what: Literal["attack", "over", "alarm", "quiet", "clock", "note"]
    link: str | None
    text: str


class Active(_Message):
    """An attack that is active."""

    number: int
    links: list[str]
    attack: str
    parameters: str
    since_step: int


class LinkDetail(_Message):
    """Residual and threshold of a link at a moment."""

    link: str
    residual: Values
    threshold: Values


class Game(_Message):
    """How a challenge stands.

    Attributes:
        why: In words.
        share: Of the goal.
        best: The best scores, once the game is over.
        cut: Links that are left out.
    """

    verdict: Literal["ready", "running", "won", "lost"]
    why: str
    moved_v: float
    share: float
    left_sec: float
    score: int
    best: list[str]
    cut: list[str]


class Frame(_Message):
    """What there is to be drawn; nothing of it is lost when a browser is slow: it gets fewer and larger ones."""

    kind: Literal["frame"] = "frame"
    time: Time
    voltage: Values
    current: Values
    alpha: Values
    mean_voltage: float | None
    links: list[LinkState]
    attacks: list[Active]
    details: list[LinkDetail]
    series: list[Series]
    log: list[Entry]
    log_anew: bool
    game: Game | None


class Reply(_Message):
    """What became of a command, in words."""

    kind: Literal["reply"] = "reply"
    id: int
    ok: bool
    text: str


class Band(_Message):
    """Between two futures, in columns: of each DGU; of a link, residual over threshold under the attack."""

    panel: str
    low: list[Values]
    high: list[Values]


class Forecast(_Message):
    """What is foreseen, for the browser that asked; `lines` says it in words."""

    kind: Literal["forecast"] = "forecast"
    id: int
    first_step: int
    steps: int
    bin_steps: int
    bands: list[Band]
    lines: list[str]


class Bye(_Message):
    """Why there will be no more messages."""

    kind: Literal["bye"] = "bye"
    text: str


ServerMessage: TypeAlias = Annotated[Outline | Frame | Reply | Forecast | Bye, Field(discriminator="kind")]

_CLIENT: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)
_SERVER: TypeAdapter[ServerMessage] = TypeAdapter(ServerMessage)


def parse_client(text: str | bytes) -> ClientMessage:
    """Read what a browser sent; raises pydantic's ValidationError."""
    return _CLIENT.validate_json(text)


def schema() -> dict[str, Any]:
    """JSON schema of both directions: `client` and `server`."""
    return {"client": _CLIENT.json_schema(), "server": _SERVER.json_schema(mode="serialization")}
