"""Commands to a running system: events <-> bytes."""

import json
from dataclasses import dataclass

from bags.mcap.errors import BagError
from bags.mcap.topic import Topic
from bags.wire.row import Spot
from bags.wire.varying import deserialize, header_of, serialize
from dgu_sim.commands import parse_command
from dgu_sim.errors import SteeringError
from dgu_sim.script import CommandEvent


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandEventCodec:
    """`dcmg_msgs/msg/CommandEvent` on /commands/events."""

    topic: Topic
    period_ns: int

    @classmethod
    def at(cls, spot: Spot) -> "CommandEventCodec":
        """The codec of a row at a place."""
        return cls(topic=spot.topic, period_ns=spot.period_ns)

    def encode(self, event: CommandEvent) -> bytes:
        """Bytes of one event."""
        fields = event.command.document()
        name = fields.pop("command")
        return serialize(
            self.topic.type_name,
            header=header_of(event.step, self.period_ns, ""),
            step=event.step,
            number=event.number,
            command=name,
            parameters=json.dumps(fields, sort_keys=True),
        )

    def decode(self, data: bytes) -> CommandEvent:
        """The event.

        Raises:
            BagError: A command that does not exist, or fields that it does not have.
        """
        message = deserialize(self.topic.type_name, data)
        try:
            fields = json.loads(message.parameters)
            command = parse_command({**fields, "command": message.command})
        except (ValueError, TypeError, SteeringError) as error:
            raise BagError(f"{self.topic.name}: command {message.number} cannot be read: {error}") from error
        return CommandEvent(step=message.step, number=message.number, command=command)
