"""The communication graph as a drawing: which links were attacked, and which accused."""

import math
from dataclasses import dataclass

from bags.reporting.judged import Judged, LinkRow
from bags.reporting.timeline import Timeline
from dgu_sim.grid import Link

SIZE = 420.0  # of the drawing, square
_NODE = 20.0  # radius of a DGU
_BEND = 0.10  # of an arrow, relative to its length


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A DGU."""

    number: int
    x: float
    y: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrow:
    """A directed link.

    Attributes:
        points: Start, control point and end of a quadratic Bézier curve.
        state: hit (every attack on it seen), partly (some seen), missed (none), false (accused only), quiet or
            unmonitored.
        title: In words.
    """

    points: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    state: str
    title: str

    @property
    def path(self) -> str:
        """As SVG path."""
        start, middle, end = self.points
        return f"M{start[0]:.1f},{start[1]:.1f} Q{middle[0]:.1f},{middle[1]:.1f} {end[0]:.1f},{end[1]:.1f}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """Everything that is drawn."""

    nodes: tuple[Node, ...]
    arrows: tuple[Arrow, ...]
    radius: float


def drawing(timeline: Timeline, judged: Judged) -> Drawing:
    """Place the DGUs on a circle and bend the two arrows of each line apart."""
    dgus = timeline.run.topics.dgus
    radius = _NODE if len(dgus) <= 16 else max(4.0, 320.0 / len(dgus))  # noqa: PLR2004 - more than that touch
    nodes = {dgu: _place(number, len(dgus), dgu) for number, dgu in enumerate(dgus)}
    arrows = []
    for found in sorted(judged.links, key=lambda one: bool(one.episodes)):
        state, title = _state(found, labelled=timeline.labelled)
        start, middle, end = _bent(nodes[found.link.source], nodes[found.link.target], radius)
        arrows.append(Arrow(points=(start, middle, end), state=state, title=f"{_name(found.link)}: {title}"))
    return Drawing(nodes=tuple(nodes.values()), arrows=tuple(arrows), radius=radius)


def _state(row: LinkRow, *, labelled: bool) -> tuple[str, str]:
    if count := len(row.episodes):
        state = "hit" if row.seen == count else "partly" if row.seen else "missed"
        return state, f"{row.seen} of {count} attacks seen"
    if row.alarms:
        return "false", f"not attacked, {row.alarms} false alarm(s)" if labelled else f"{row.alarms} alarm(s)"
    return ("quiet", "not accused") if row.monitored else ("unmonitored", "not monitored")


def _place(number: int, count: int, dgu: int) -> Node:
    angle = -math.pi / 2 + 2 * math.pi * number / max(count, 1)
    reach = SIZE / 2 - _NODE - 14 if count > 1 else 0.0
    return Node(number=dgu, x=SIZE / 2 + reach * math.cos(angle), y=SIZE / 2 + reach * math.sin(angle))


def _bent(source: Node, target: Node, radius: float) -> list[tuple[float, float]]:
    """A bent arrow from the rim of one circle to that of the other."""
    dx, dy = target.x - source.x, target.y - source.y
    length = math.hypot(dx, dy) or 1.0
    bend = _BEND * length
    middle = ((source.x + target.x) / 2 - bend * dy / length, (source.y + target.y) / 2 + bend * dx / length)
    return [_rim(source, middle, radius + 2), middle, _rim(target, middle, radius + 9)]


def _rim(node: Node, towards: tuple[float, float], distance: float) -> tuple[float, float]:
    dx, dy = towards[0] - node.x, towards[1] - node.y
    length = math.hypot(dx, dy) or 1.0
    return node.x + distance * dx / length, node.y + distance * dy / length


def _name(link: Link) -> str:
    return f"{link.source} → {link.target}"
