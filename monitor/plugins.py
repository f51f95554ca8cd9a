"""Kinds that installed packages add, by entry point: each is imported when somebody asks for it.

`dgu_sim/plugins.py` repeats this: the two packages do not import each other.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from monitor.errors import PlugInError

__all__ = ["Kinds", "PlugIn", "plug_ins"]

Kind = TypeVar("Kind")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlugIn:
    """What an installed package adds.

    Attributes:
        package: Name of the distribution, as pip knows it.
        version: Its version.
        point: The entry point: its name is that of the kind.
    """

    package: str
    version: str
    point: EntryPoint

    def __str__(self) -> str:
        """Package, version and entry point."""
        return f"{self.package} {self.version} (entry point {self.point.name} = {self.point.value})"

    def load(self) -> object:
        """Import it.

        Raises:
            PlugInError: That fails: one line with package, version and entry point.
        """
        try:
            return self.point.load()
        except (Exception, SystemExit) as error:  # whatever a stranger's module does
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise PlugInError(f"plug-in {self} cannot be imported: {reason}") from error


@cache
def plug_ins(group: str) -> Mapping[str, tuple[PlugIn, ...]]:
    """Return what the installed packages add to a group, by kind."""
    found: dict[str, tuple[PlugIn, ...]] = {}
    for point in sorted(entry_points(group=group), key=lambda one: (one.name, one.value)):
        package = ("an unknown package", "") if point.dist is None else (point.dist.name, point.dist.version)
        one = PlugIn(package=package[0], version=package[1], point=point)
        found[point.name] = (*found.get(point.name, ()), one)
    return found


class Kinds(Mapping[str, Kind], Generic[Kind]):
    """The kinds that are shipped, and behind them those of plug-ins; whoever lists them imports none.

    Args:
        group: Group of entry points.
        shipped: Ours.
        checked: Returns what an entry point named as a kind of this name, or raises PlugInError with what was expected.
    """

    def __init__(self, group: str, shipped: Mapping[str, Kind], checked: Callable[[str, object], Kind]) -> None:
        """Look nowhere yet."""
        self.group, self.shipped = group, shipped
        self._checked = checked

    def __getitem__(self, kind: str) -> Kind:
        """Return a kind.

        Raises:
            KeyError: There is none.
            PlugInError: It is of a plug-in that cannot be used, or of several packages.
        """
        found = plug_ins(self.group).get(kind, ())
        if not found:
            return self.shipped[kind]
        if len(found) > 1 or kind in self.shipped:
            others = ["dcmg itself"] * (kind in self.shipped) + [str(one) for one in found[1:]]
            raise PlugInError(f"plug-in {found[0]}: {', '.join(others)} has a {kind} too; uninstall one, or rename it")
        made = found[0].load()
        try:
            return self._checked(kind, made)
        except PlugInError as error:
            raise PlugInError(f"plug-in {found[0]}: {error}") from error

    def __contains__(self, kind: object) -> bool:
        """Whether there is such a kind, usable or not."""
        return kind in self.shipped or kind in plug_ins(self.group)

    def __iter__(self) -> Iterator[str]:
        """Shipped ones first."""
        yield from self.shipped
        yield from (kind for kind in plug_ins(self.group) if kind not in self.shipped)

    def __len__(self) -> int:
        """Return how many there are."""
        return sum(1 for _ in self)
