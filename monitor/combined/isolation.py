"""Which link lies: a pure function of what every test of one monitor says at one step."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from monitor.linear import negated, select

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monitor.linear import Component, Flag

Flags = tuple["Flag", ...]


class Evidence(NamedTuple):
    """What the tests of one monitor say; one flag for each incoming link, ascending, where not said otherwise.

    Attributes:
        residual: the observer's residual exceeds its threshold.
        plausibility: the reconstructed input is not plausible.
        stream: the stream of samples is broken.
        local: the own state's residual exceeds its threshold; one flag.
        explains: this link's voltage alone could be the lie behind the own state's residual.
    """

    residual: Sequence[Flag]
    plausibility: Sequence[Flag]
    stream: Sequence[Flag]
    local: Flag
    explains: Sequence[Flag]


class Isolation(NamedTuple):
    """Who is accused and why; one flag for each incoming link, the fields are those of dcmg_msgs/Verdict."""

    accused: Flags
    by_residual: Flags
    by_plausibility: Flags
    by_stream: Flags
    by_local: Flags
    suspected: Flags
    local: Flag


def isolate(evidence: Evidence) -> Isolation:
    """Name the links that lie.

    A test that looks at one link accuses it: several such links at once are the coordinated set. The own state's
    residual adds all neighbours' voltages up and accuses no single link by itself: only when nothing else does, the
    links are tried one by one. If exactly one alone could have caused it, that one is accused; otherwise those that
    could are suspected, and all of them when none could alone: they lie together, or the own load is not what it was.
    """
    direct = [
        residual | plausibility | stream
        for residual, plausibility, stream in zip(
            evidence.residual, evidence.plausibility, evidence.stream, strict=True
        )
    ]
    silent: Flag = True
    for flag in direct:
        silent = silent & negated(flag)
    unexplained = evidence.local & silent
    candidates: Component = 0.0
    for flag in evidence.explains:
        candidates = candidates + select(flag, 1.0, 0.0)
    one, none = candidates == 1.0, candidates == 0.0
    by_local = tuple([unexplained & one & flag for flag in evidence.explains])
    return Isolation(
        accused=tuple([flag | only for flag, only in zip(direct, by_local, strict=True)]),
        by_residual=tuple(evidence.residual),
        by_plausibility=tuple(evidence.plausibility),
        by_stream=tuple(evidence.stream),
        by_local=by_local,
        suspected=tuple([unexplained & negated(one) & (flag | none) for flag in evidence.explains]),
        local=evidence.local,
    )


def explains(excess: Component, conductance: float, reference: Component, lower: Component, upper: Component) -> Flag:
    """Tell whether one neighbour's false voltage alone could be the current that nothing else explains.

    It would be false by excess / conductance. At rest a voltage is its reference, so the reference that was
    reconstructed from what the neighbour sends would be false by as much: the true one must have been plausible.

    Args:
        excess: unexplained current [A].
        conductance: 1/R of the line [S]; 0: the neighbour does not act on the own state.
        reference: the neighbour's reference as reconstructed [V]; NaN: not known, then everything is possible.
        lower: least plausible reference [V].
        upper: largest plausible reference [V].
    """
    if conductance == 0.0:
        return excess < excess  # noqa: PLR0124 - False, in the shape of the others
    true = reference - excess / conductance
    return negated((true < lower) | (true > upper))
