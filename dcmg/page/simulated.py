"""A simulation in this process as what is shown: attacked by hand, as long as somebody looks."""

import numpy as np

from bags.runs.following import Followed
from bags.runs.live import LiveRun
from bags.watch.designs import RunDesigns
from dcmg.page.attack_forms import order_of
from dcmg.page.board import Board, Steps
from dcmg.page.messages import Attack, Outline
from dcmg.page.outlines import link_facts, outline
from dcmg.page.source import RefusalError
from dgu_sim.errors import AttackError
from dgu_sim.scenario import Scenario


class Simulated:
    """The time loop, a few steps at a time.

    Args:
        scenario: What runs.
        designs: What its monitors run.
        steps: After how many it ends, None: never.
    """

    def __init__(self, scenario: Scenario, designs: RunDesigns, steps: int | None) -> None:
        """Stand before step 0."""
        self.run = LiveRun.of(scenario, designs)
        self._steps = steps
        topics = designs.topics
        outputs = topics.widths.outputs
        links = [
            link_facts(link, accepted=one.accepted, verdict=one.verdict, document=one.document, outputs=outputs)
            for link, one in zip(topics.links, designs.links, strict=True)
        ]
        self.outline: Outline = outline(
            scenario,
            links,
            topics.dgus,
            source="simulation",
            name=scenario.name,
            sampling_period_sec=scenario.sampling_period_sec,
            end_step=steps,
            outputs=outputs,
        )
        self.board = Board(topics.dgus, topics.links, scenario.sampling_period_sec, outputs)

    @property
    def head(self) -> int:
        """The next step."""
        return self.run.state.step

    def advance(self, steps: int) -> int:
        """Simulate; see `Source`."""
        count = steps if self._steps is None else min(steps, self._steps - self.head)
        if count > 0:
            self.board.add(happened(self.run.advance(count)))
        return max(count, 0)

    def seek(self, step: int) -> None:
        """Refuse: what was simulated is over."""
        raise RefusalError(f"step {step}: a simulation goes forward only; record it and open its bag to go back")

    def attack(self, order: Attack) -> str:
        """See `Source`."""
        links, parameters = order_of(order)
        if order.anyway:
            parameters["anyway"] = True
        named = f"{order.attack} on {', '.join(map(str, links))}"
        asked = (links[0], order.attack, parameters, order.duration_sec)
        try:
            if order.action == "check":
                self.run.check(*asked)
                return f"{named}: can start"
            if order.action == "stop":
                self.run.stop(links[0])
                return f"stopped on {links[0]}"
            event = (self.run.change if order.action == "change" else self.run.start)(*asked)
        except AttackError as error:
            raise RefusalError(str(error)) from error
        return f"{'changed to' if order.action == 'change' else 'started'} attack {event.attack}: {named}"

    def fork(self) -> LiveRun:
        """See `Source`."""
        return self.run.fork()

    def close(self) -> None:
        """Nothing is held."""


def happened(followed: Followed) -> Steps:
    """The steps of one run in memory, as they are shown."""
    block, links = followed.block, followed.links
    return Steps(
        first_step=block.first_step,
        voltage=block.y[:, 0, :, 0],
        current=block.y[:, 0, :, 1],
        alpha=block.alpha[:, 0],
        residual=links.residual,
        threshold=links.threshold,
        alarm=np.asarray(links.alarm, dtype=np.bool_),
        phase=links.phase,
        events=[one.event for one in block.events],
    )
