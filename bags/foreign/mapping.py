"""The mapping file: which foreign numbers are what, in which units, and how they are sampled."""

from collections.abc import Mapping as MappingType
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from bags.foreign.sampling import Policy
from bags.foreign.stamps import Stamps
from bags.foreign.units import factor_of
from bags.mcap.errors import BagError
from bags.wire.row import Widths
from dgu_sim.errors import ScenarioError
from dgu_sim.grid import Link
from dgu_sim.model import Frozen, Number, finding
from dgu_sim.scenario_file import embed_waveforms, parse_yaml, read_text, validated
from dgu_sim.settings import AttackSettings
from monitor.settings import MonitorSettings

_HOLD_PERIODS = 1.5


def _signal(value: object) -> object:
    """Make `field` or `field*factor` a signal."""
    if not isinstance(value, str):
        return value
    name, star, factor = value.rpartition("*")
    try:
        return {"field": name.strip(), "scale": float(factor)} if star else {"field": value.strip()}
    except ValueError:
        return {"field": value.strip()}


class Signal(Frozen):
    """One number: scale * unit * raw + offset, in SI units."""

    field: str = Field(
        min_length=1, description="`/topic.field.inner[0]` in a bag or live, a column's name in a table."
    )
    unit: str = Field(
        default="1", description="Unit of the raw number: V, A, V s, s, W, Ohm with n, u, m, k or M, or 1."
    )
    scale: Number = Field(default=1.0, description="Factor.")
    offset: Number = Field(default=0.0, description="Added at the end, in SI units.")

    @model_validator(mode="after")
    def _known_unit(self) -> Self:
        try:
            factor_of(self.unit)
        except BagError as error:
            raise finding(("unit",), self.unit, str(error).partition(": ")[2]) from None
        return self

    @property
    def is_bare(self) -> bool:
        """Whether nothing says how large the raw number 1 is: then the recording may."""
        return self.unit == "1" and self.scale == 1.0

    @property
    def factor(self) -> float:
        """SI value of the raw number 1, without the offset."""
        return self.scale * factor_of(self.unit)


Signals = tuple[Annotated[Signal, BeforeValidator(_signal)], ...]
OneSignal = Annotated[Signal, BeforeValidator(_signal)]


class SamplingSettings(Frozen):
    """How messages become one sample a period."""

    policy: Policy = Field(default=Policy.REFUSE, description="refuse, nearest, hold or linear.")
    tolerance: Number = Field(
        default=0.01, gt=0, lt=0.5, description="Share of T_s by which an instant may be off (refuse, hold)."
    )
    max_gap_sec: Number | None = Field(
        default=None, gt=0, description="Longest time that hold holds and linear bridges [s]; default: 1.5 T_s."
    )
    late_sec: Number = Field(
        default=0.1, gt=0, description="Live: a sample this late is not delivered; at least 2 T_s are waited [s]."
    )

    def max_gap_ns(self, period_ns: int) -> int:
        """Longest time without a message that is bridged [ns]."""
        return round(_HOLD_PERIODS * period_ns if self.max_gap_sec is None else self.max_gap_sec * 1e9)


class HistoryMapping(Frozen):
    """An offline experiment on one DGU."""

    start_sec: Number = Field(default=0.0, ge=0, description="Begins here, since the first mapped message [s].")
    stop_sec: Number | None = Field(default=None, gt=0, description="Ends before this [s]; default: at the end.")
    dgu: int = Field(ge=1, description="Number of the DGU that was measured.")
    y: Signals = Field(min_length=1, description="Outputs as they are sent over the network.")
    x: Signals = Field(default=(), description="States; default: the outputs are the states.")
    u: Signals = Field(default=(), description="Known inputs.")
    d: Signals = Field(default=(), description="Inputs applied in the experiment that are unknown online.")
    w: Signals = Field(default=(), description="What only the DGU itself measures: load current, neighbours' voltages.")

    @property
    def tables(self) -> dict[str, tuple[Signal, ...]]:
        """Signals of each table of a history."""
        return {"u": self.u, "y": self.y, "x": self.x or self.y, "d": self.d, "w": self.w}


class StreamMapping(Frozen):
    """What one DGU receives from another."""

    link: str = Field(description='"SOURCE-TARGET": from the watched DGU to the one that hosts the monitor.')
    y: Signals = Field(min_length=1, description="Received outputs, those of the history.")
    u: Signals = Field(default=(), description="Known inputs of the sender, those of the history; default: none.")
    delivered: OneSignal | None = Field(
        default=None, description="0 where the link lost the sample; default: all came."
    )

    @model_validator(mode="after")
    def _is_link(self) -> Self:
        source, dash, target = self.link.partition("-")
        if not (
            dash and source.isdecimal() and target.isdecimal() and int(source) and int(target) and source != target
        ):
            raise finding(("link",), self.link, "expected two different DGU numbers, as in 1-2")
        return self

    @property
    def ends(self) -> Link:
        """The link."""
        source, _, target = self.link.partition("-")
        return Link(int(source), int(target))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Outputs and known inputs, then whether they were delivered."""
        return (*self.y, *self.u, *([self.delivered] if self.delivered else []))


class Mapping(Frozen):
    """A mapping file."""

    sampling_period_sec: Number | None = Field(
        default=None, gt=0, description="T_s [s]; default: detected, live: that of the history."
    )
    time: OneSignal | None = Field(default=None, description="Column of the instants of a table [s] after its unit.")
    stamps: Stamps = Field(
        default=Stamps.AUTO, description="Clock of messages: header, recorded (live: arrival) or auto."
    )
    sampling: SamplingSettings = Field(default_factory=SamplingSettings, description="Grid and policy.")
    histories: tuple[HistoryMapping, ...] = Field(default=(), description="Offline experiments.")
    start_sec: Number = Field(default=0.0, ge=0, description="Streams begin here, since the first mapped message [s].")
    stop_sec: Number | None = Field(default=None, gt=0, description="Streams end before this [s]; default: at the end.")
    streams: tuple[StreamMapping, ...] = Field(default=(), description="Received outputs to monitor.")
    attacks: tuple[AttackSettings, ...] = Field(
        default=(),
        description="Attacks that falsify the streams, as those of a scenario; none that needs a running grid.",
    )
    seed: int = Field(default=0, ge=0, description="Seed of attacks that draw random numbers.")
    monitor: MonitorSettings = Field(default_factory=MonitorSettings, description="Observer and detector.")

    @model_validator(mode="after")
    def _each_link_once(self) -> Self:
        links = [one.link for one in self.streams]
        for position, link in enumerate(links):
            if link in links[:position]:
                raise finding(("streams", position, "link"), link, "expected each link once")
        for position, attack in enumerate(self.attacks):
            for link in attack.link_names:
                if link not in links:
                    raise finding(("attacks", position, "link"), link, f"expected a stream's link: {', '.join(links)}")
        return self

    @property
    def period_ns(self) -> int | None:
        """T_s [ns], None: not stated."""
        return None if self.sampling_period_sec is None else round(self.sampling_period_sec * 1e9)


def load_mapping(path: Path | str) -> Mapping:
    """Read and check a mapping file.

    Raises:
        BagError: One line with file, key, value and what was expected.
    """
    return mapping_of(load_data(path), str(path))


def load_data(path: Path | str) -> dict[str, Any]:
    """The plain data of a mapping file, unchecked.

    Raises:
        BagError: It cannot be read or is no YAML mapping.
    """
    path = Path(path)
    try:
        data = parse_yaml(read_text(path, "mapping file"), str(path))
        embed_waveforms(data, str(path), path.parent)
    except ScenarioError as error:
        raise BagError(str(error).replace("a mapping of scenario keys", "a mapping of keys")) from error
    return data


def mapping_of(data: MappingType[str, object], source: str) -> Mapping:
    """Check a mapping given as plain data.

    Args:
        data: Keys and values.
        source: What to call it in messages.

    Raises:
        BagError: One line with source, key, value and what was expected.
    """
    try:
        return validated(Mapping, dict(data), source)
    except ScenarioError as error:
        raise BagError(str(error)) from error


def stream_widths(streams: Sequence[StreamMapping], states: int | None = None) -> Widths:
    """Outputs and known inputs of the widest stream; states as given, or as many as outputs."""
    outputs = max(len(one.y) for one in streams)
    return Widths(
        outputs=outputs, states=outputs if states is None else states, inputs=max(len(one.u) for one in streams)
    )
