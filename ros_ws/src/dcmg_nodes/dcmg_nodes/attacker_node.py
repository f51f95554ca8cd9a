"""The attacker: a relay on every communication link, transparent until an attack is started on one."""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING

from dcmg_msgs.msg import AttackEvent
from dcmg_msgs.srv import ListAttacks, StartAttack, StopAttack
from rclpy.serialization import deserialize_message

from bags.wire.schema import ATTACKER_NODE
from dcmg_nodes.attack_services import LIST_SERVICE, START_SERVICE, STOP_SERVICE
from dcmg_nodes.inbox import Inbox
from dcmg_nodes.ports import Ports
from dcmg_nodes.second_publisher import SecondPublishers
from dcmg_nodes.services import offer
from dgu_sim.attacks.request import parse_parameters
from dgu_sim.errors import AttackError
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dcmg_nodes.host import Host
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.relay import Relay, RelayEvent, RelayState


class AttackerNode:
    """Fires step k when the outputs of all DGUs for step k are in; relays them on every link."""

    def __init__(self, wiring: Wiring, host: Host, relay: Relay, state: RelayState, steps: int) -> None:
        """Subscribe to every output and offer the services that start, stop and list attacks."""
        self.ports = Ports(ATTACKER_NODE, wiring, host)
        self._relay = relay
        self._state = state
        self._step = 0
        self._steps = steps
        topics = wiring.topics
        self._outputs = [topics.output(dgu) for dgu in topics.dgus]
        self._inbox: Inbox[bytes] = Inbox([codec.topic.name for codec in self._outputs])
        self.ports.waits_for(self._inbox.missing)
        self._complete: deque[Sequence[bytes]] = deque()
        self._seconds = SecondPublishers(self.ports, self._advance)
        for slot, codec in enumerate(self._outputs):
            self.ports.subscribe(codec.topic, partial(self._receive, slot))
        self._received = [topics.received(link) for link in topics.links]
        self._events = topics.attack_events()
        node = self.ports.node
        self._services = (
            offer(node, StartAttack, START_SERVICE, self._on_start),
            offer(node, StopAttack, STOP_SERVICE, self._on_stop),
            node.create_service(ListAttacks, LIST_SERVICE, self._on_list),
        )

    def _receive(self, slot: int, data: bytes) -> None:
        tokens = self._inbox.push(slot, data)
        while tokens is not None:
            self._complete.append([token for token in tokens if token is not None])
            tokens = self._inbox.take()
        self._advance()

    def _advance(self) -> None:
        """Fire what is complete, unless readers do not know yet how many messages the step will have."""
        while self._complete and self._seconds.tell(self._relay.spoofings(self._state), self._step):
            self._fire(self._complete.popleft())

    def _fire(self, tokens: Sequence[bytes]) -> None:
        outputs = [codec.decode(data)[1] for codec, data in zip(self._outputs, tokens, strict=True)]
        self._state, samples, events = self._relay.step(self._state, outputs)
        self._announce(events)
        for codec, sample in zip(self._received, samples, strict=True):
            self.ports.publish(codec.topic.name, codec.encode(self._step, sample))
        for position, sample in self._state.spoofed:
            self._seconds.send(self._relay.links[position], self._received[position].encode(self._step, sample))
        self._step += 1
        if self._step == self._steps:
            self.ports.finish()

    def _announce(self, events: Sequence[RelayEvent]) -> None:
        for event in events:
            self.ports.publish(self._events.topic.name, self._events.encode(event))

    def _on_start(self, request: StartAttack.Request, response: StartAttack.Response) -> StartAttack.Response:
        if self._step == 0:  # the recorder need not be listening yet, and the bag would not tell of the attack
            raise AttackError("the run has not begun yet: try again when its clock moves")
        link, parameters = Link(request.source, request.target), parse_parameters(request.parameters)
        state, event = self._relay.start(self._state, link, request.kind, parameters, request.duration_sec)
        self._announce([event])
        self._state = state
        response.accepted, response.attack, response.step = True, event.attack, event.step
        return response

    def _on_stop(self, request: StopAttack.Request, response: StopAttack.Response) -> StopAttack.Response:
        state, events = self._relay.stop(self._state, Link(request.source, request.target))
        self._announce(events)
        self._state = state
        response.accepted, response.stopped, response.step = True, len(events), self._step
        return response

    def _on_list(self, _request: ListAttacks.Request, response: ListAttacks.Response) -> ListAttacks.Response:
        response.step = self._step
        for event, stop_sec in self._relay.pending(self._state):
            response.attacks.append(deserialize_message(self._events.encode(event), AttackEvent))
            response.stop_sec.append(stop_sec)
        return response
