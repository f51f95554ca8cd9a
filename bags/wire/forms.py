"""Records of the simulator and the monitors <-> numbers of fixed-length messages, behind header, step and constants.

The nodes' hot path: each pair is as direct as it can be, and what depends on the widths of a run is looked up once.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from bags.mcap.cdr import Layout
from bags.wire.row import Form
from dgu_sim.records import Physical, Sample
from monitor.combined import DguVerdict, InputOutput, Isolation, Own
from monitor.link_monitor import MonitorOutput
from monitor.team import MemberOutput

if TYPE_CHECKING:
    from dgu_sim.unit import UnitOutput
    from monitor.linear import Flag

Numbers = tuple[Any, ...]

MASKS = (*(name for name in Isolation._fields if name != "local"), "dropped")
"""Fields of Verdict.msg, and of an Isolation and its verdict, that have one bit for each incoming link."""


def mask_of(flags: "Sequence[Flag]") -> int:
    """Bit i is flag i."""
    return sum(1 << bit for bit, flag in enumerate(flags) if flag)


def width_of(layout: Layout, name: str) -> int:
    """Elements of a field: of a vector, or 1."""
    shape = layout.dtype[name].shape
    return int(shape[0]) if shape else 1


def _record(kind: Callable[..., Any], scalars: int, vectors: Sequence[str]) -> Callable[[Layout, int], Any]:
    """Records whose fields are some numbers and then vectors, in the order of the message."""

    def made(layout: Layout, _links: int) -> Callable[[Numbers], Any]:
        slices, at = [], scalars
        for name in vectors:
            slices.append(slice(at, at + width_of(layout, name)))
            at = slices[-1].stop
        return lambda numbers: kind(*numbers[:scalars], *[numbers[one] for one in slices])

    return made


def _sample(layout: Layout, _links: int) -> Callable[[Numbers], Sample]:
    end = 1 + width_of(layout, "y")
    return lambda numbers: Sample(y=numbers[1:end], delivered=numbers[0], u=numbers[end:])


def _physical(layout: Layout, _links: int) -> Callable[[Numbers], Physical]:
    n = width_of(layout, "x")
    return lambda numbers: Physical(x=numbers[:n], load_current=numbers[n], reference=numbers[n + 1])


def _own(_layout: Layout, _links: int) -> Callable[[Numbers], Own]:
    return lambda numbers: Own(numbers[:-1], numbers[-1])


def _verdict(_layout: Layout, links: int) -> Callable[[Numbers], DguVerdict]:
    def flags(mask: int) -> tuple[bool, ...]:
        return tuple(bool(mask >> bit & 1) for bit in range(links))

    def made(numbers: Numbers) -> DguVerdict:
        *masks, local, dropped = numbers
        return DguVerdict(Isolation._make((*map(flags, masks), bool(local))), flags(dropped))

    return made


def _flat_state(output: "UnitOutput") -> Sequence[Any]:
    return (*output.x, output.load_current, output.reference, output.alpha)


def _flat_verdict(verdict: DguVerdict) -> Sequence[Any]:
    *masks, local = verdict.isolation
    return (*map(mask_of, masks), local, mask_of(verdict.dropped))


def _flat_member(output: MemberOutput) -> Sequence[Any]:
    return (output.phase, *output.alarm, *output.estimate, *output.disagreement, *output.threshold)


STATE = Form(_flat_state, _physical)
OUTPUT = Form(lambda sample: (sample.delivered, *sample.y, *sample.u), _sample)
OWN = Form(lambda own: (*own.y, own.reference), _own)
VERDICT = Form(
    lambda said: (said.phase, said.alarm, *said.estimate, *said.residual, *said.threshold),
    _record(MonitorOutput, 2, MonitorOutput._fields[2:]),
)
INPUT = Form(
    lambda lag, said: (lag, said.phase, said.alarm, *said.input, *said.lower, *said.upper, *said.rate),
    _record(lambda lag, *fields: (lag, InputOutput(*fields)), 3, InputOutput._fields[2:]),
)
ISOLATION = Form(_flat_verdict, _verdict)
ANNOUNCED = Form(lambda inputs: inputs, lambda _layout, _links: lambda numbers: numbers)
MEMBER = Form(_flat_member, _record(MemberOutput, 1, MemberOutput._fields[1:]))
NOTHING = Form(tuple, lambda _layout, _links: lambda numbers: numbers)
