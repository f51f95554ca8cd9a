"""What must hold between the sections of a scenario."""

from collections.abc import Sequence

from dgu_sim.commands import unknown_place
from dgu_sim.errors import AttackError
from dgu_sim.explain import listed
from dgu_sim.grid import Grid, Link
from dgu_sim.model import finding
from dgu_sim.plant import Coupling
from dgu_sim.sections import Sections
from dgu_sim.settings import AttackSettings, HistoryPlant, OutputComponent
from dgu_sim.stability import closed_loop, largest_stable_gain, sampled_grid, spectral_radius

__all__ = ["check_parts", "check_stability"]

LINE_TIME_SHARE = 0.1
"""Lines count as quasi-stationary when L/R is at most this share of T_s; G's reach 0.6 %."""


def check_parts(scenario: Sections) -> None:
    """Check that ids, lines, links and times fit together; raises what `dgu_sim.model.finding` returns."""
    ids = [dgu.id for dgu in scenario.dgus]
    _check_ids(scenario, ids)
    _check_lines(scenario)
    _check_attacks(scenario)
    for index, entry in enumerate(scenario.script):
        misplaced = unknown_place(entry.order, [dgu.id for dgu in scenario.dgus], scenario.links)
        if misplaced is not None:
            raise finding(("script", index, misplaced[0]), *misplaced[1:])
    for index, poison in enumerate(scenario.poison):
        if poison.dgu not in ids:
            known = listed(ids)
            raise finding(("poison", index, "dgu"), poison.dgu, f"expected one of the DGUs {known}")
    if scenario.coupling is Coupling.ISOLATED and scenario.history.plant is HistoryPlant.JOINT:
        raise finding(("history", "plant"), "joint", "expected own: with coupling isolated there is no joint grid")


def check_stability(scenario: Sections, grid: Grid) -> None:
    """Check that the sampled closed loop of the whole grid is stable; raises what `finding` returns."""
    A, E = sampled_grid(grid, scenario.coupling, scenario.sampling_period_sec)
    radius = spectral_radius(A)
    if radius >= 1.0:
        expected = f"expected a stable grid, found spectral radius {radius:.5g} without secondary control"
        raise finding(("coupling",), str(scenario.coupling), f"{expected}: use joint or a shorter sampling_period_sec")
    if not scenario.secondary.enabled:
        return
    key, gain = ("secondary", "gain"), scenario.secondary.gain
    if scenario.coupling is Coupling.ISOLATED:
        expected = "expected false: with coupling isolated no current answers to alpha, which would run away"
        raise finding(("secondary", "enabled"), True, expected)  # noqa: FBT003 - the value found
    rated = [dgu.rated_current_a for dgu in scenario.dgus]
    step_gain = scenario.sampling_period_sec * gain
    radius = spectral_radius(closed_loop(A, E, grid.laplacian(), rated, step_gain), len(grid.components()))
    if radius >= 1.0:
        limit = largest_stable_gain(A, E, grid, rated, step_gain) / scenario.sampling_period_sec
        expected = f"expected a gain that is stable when sampled every {scenario.sampling_period_sec:g} s"
        raise finding(key, gain, f"{expected}, below {limit:.4g}; spectral radius is {radius:.5f}")


def _check_ids(scenario: Sections, ids: Sequence[int]) -> None:
    seen = set(ids[:1])
    for index in range(1, len(ids)):
        key = _place(scenario, "dgus", index, "id")
        if ids[index] in seen:
            raise finding(key, ids[index], "expected an id that no other DGU has")
        if ids[index] < ids[index - 1]:
            raise finding(key, ids[index], f"expected an id above {ids[index - 1]}: ids ascend")
        seen.add(ids[index])


def _place(scenario: Sections, section: str, index: int, name: str) -> tuple[str | int, ...]:
    """Return the key under which the file says something of one DGU or line."""
    if scenario.generator is None:
        return section, index, name
    listed_there = getattr(getattr(scenario.generator, section, None), name, None) is not None
    return ("grid", section, name, index) if listed_there else ("grid", section[:-1], name)


def _check_lines(scenario: Sections) -> None:
    ids = [dgu.id for dgu in scenario.dgus]
    known = set(ids)
    seen: set[frozenset[int]] = set()
    for index, line in enumerate(scenario.lines):
        key: tuple[str | int, ...] = (
            ("lines", index, "between") if scenario.generator is None else ("grid", "lines", "second", index)
        )
        for dgu in line.between:
            if dgu not in known:
                raise finding(key, list(line.between), f"expected two of the DGUs {listed(ids)}: there is no DGU {dgu}")
        if line.between[0] == line.between[1]:
            raise finding(key, list(line.between), "expected two different DGUs")
        if frozenset(line.between) in seen:
            raise finding(key, list(line.between), "expected one line between two DGUs: this one is a second")
        seen.add(frozenset(line.between))
        longest = LINE_TIME_SHARE * scenario.sampling_period_sec * line.resistance_ohm
        if line.inductance_h > longest:
            expected = f"expected at most {longest:.3g}: lines are quasi-stationary, L/R <= sampling_period_sec / 10"
            raise finding(_place(scenario, "lines", index, "inductance_h"), line.inductance_h, expected)


def _check_attacks(scenario: Sections) -> None:
    links = {Link(a, b) for line in scenario.lines for a, b in (line.between, line.between[::-1])}
    for index, attack in enumerate(scenario.attacks):
        _check_links(scenario, attack, ("attacks", index), links)


def _check_links(scenario: Sections, attack: AttackSettings, key: tuple[str | int, ...], links: set[Link]) -> None:
    for position, name in enumerate(attack.link_names):
        place = (*key, "link") if attack.links is None else (*key, "links", position)
        try:
            link = Link.parse(name)
        except AttackError:
            raise finding(place, name, "expected SOURCE-TARGET, like 1-2") from None
        if link not in links:
            known = listed(sorted(str(one) for one in links)) or "none: the scenario has no lines"
            raise finding(place, name, f"expected a communication link: {known}")
        hidden = [one.value for one in OutputComponent if one not in scenario.dgu(link.source).output]
        if attack.attack.whole_output and hidden:
            expected = f"expected a link whose source sends V, I_t and v: DGU {link.source} keeps {listed(hidden)}"
            raise finding(place, name, f"{expected}, and {attack.kind} starts from whole samples")
        if name in attack.link_names[:position]:
            raise finding(place, name, "expected a link that does not stand before it")
    try:
        attack.attack.check_links(attack.plan.links)
    except AttackError as error:
        raise finding((*key, "links"), list(attack.link_names), str(error)) from None
