"""The table of messages: every topic of a run is one row, in canonical order.

The order of the rows is the order of the messages of one step in a bag and of the channels in its file: so a run in
processes, composed, or offline leaves the same messages in the same order. Per-step messages come first, then the
events of that step; latched messages stand before step 0.
"""

from collections.abc import Sequence
from typing import Any

from bags.mcap.topic import TopicKind
from bags.wire import forms
from bags.wire.codecs import AlarmCodec, ClockCodec, StepCodec
from bags.wire.commands import CommandEventCodec
from bags.wire.documents import AttackEventCodec, DesignCodec, DiagnosticsCodec, HistoryCodec
from bags.wire.row import Need, Over, Row
from bags.wire.stream import StreamCodec

_SAMPLE = {"y": "outputs", "u": "inputs"}
_JUDGED = {"estimate": "states", "residual": "outputs", "threshold": "outputs"}
_LINK = {"source": "i", "monitor": "j"}
_RECEIVED = "/dgu_{j}/received/dgu_{i}"

CLOCK = Row(
    key="clock",
    name="/clock",
    type_name="rosgraph_msgs/msg/Clock",
    codec=ClockCodec.at,
    over=Over.RUN,
    publisher="clock",
    says="simulated time",
)
TICK = Row(
    key="tick",
    name="/tick",
    type_name="dcmg_msgs/msg/Tick",
    codec=StepCodec.at,
    over=Over.RUN,
    publisher="clock",
    says="step k is released",
    readers=("dgu_{all}",),
)
STATE = Row(
    key="state",
    name="/dgu_{i}/state",
    type_name="dcmg_msgs/msg/State",
    codec=StepCodec.at,
    over=Over.DGUS,
    publisher="dgu_{i}",
    says="ground truth",
    readers=("dgu_{coupled}",),
    frame="dgu_{i}",
    numbers={"dgu": "i"},
    sequences={"x": "states"},
    form=forms.STATE,
)
OUTPUT = Row(
    key="output",
    name="/dgu_{i}/output",
    type_name="dcmg_msgs/msg/Output",
    codec=StepCodec.at,
    over=Over.DGUS,
    publisher="dgu_{i}",
    says="output as sent",
    readers=("attacker", "monitor_{member}"),
    frame="dgu_{i}",
    numbers={"source": "i"},
    sequences=_SAMPLE,
    form=forms.OUTPUT,
)
OWN = Row(
    key="own",
    name="/dgu_{i}/own",
    type_name="dcmg_msgs/msg/Own",
    codec=StepCodec.at,
    over=Over.MONITORS,
    publisher="dgu_{i}",
    says="what a DGU itself measures and decides",
    readers=("monitor_{i}",),
    frame="dgu_{i}",
    numbers={"dgu": "i"},
    sequences={"y": "outputs"},
    elsewhere={"y": "output.y", "reference": "state.reference"},
    form=forms.OWN,
    need=Need.LOCAL,
)
RECEIVED = Row(
    key="received",
    name=_RECEIVED,
    type_name="dcmg_msgs/msg/Output",
    codec=StepCodec.at,
    over=Over.LINKS,
    publisher="attacker",
    says="output as received",
    readers=("dgu_{j}", "monitor_{j}"),
    frame="dgu_{i}",
    numbers={"source": "i"},
    sequences=_SAMPLE,
    form=forms.OUTPUT,
)
RESIDUAL = Row(
    key="residual",
    name="/dgu_{j}/residual/dgu_{i}",
    type_name="dcmg_msgs/msg/Residual",
    codec=StepCodec.at,
    over=Over.LINKS,
    publisher="monitor_{j}",
    says="what the monitor of a link concludes",
    frame="dgu_{j}",
    numbers=_LINK,
    sequences=_JUDGED,
    form=forms.VERDICT,
)
OWN_RESIDUAL = Row(
    key="own_residual",
    name="/dgu_{j}/residual/dgu_{i}",
    type_name="dcmg_msgs/msg/Residual",
    codec=StepCodec.at,
    over=Over.MONITORS,
    publisher="monitor_{j}",
    says="what the module of the own state concludes",
    frame="dgu_{j}",
    numbers=_LINK,
    sequences=_JUDGED,
    form=forms.VERDICT,
    need=Need.LOCAL,
)
INPUT = Row(
    key="input",
    name="/dgu_{j}/input/dgu_{i}",
    type_name="dcmg_msgs/msg/InputEstimate",
    codec=StepCodec.at,
    over=Over.LINKS,
    publisher="monitor_{j}",
    says="what must have acted on the sender",
    frame="dgu_{j}",
    numbers=_LINK,
    sequences=dict.fromkeys(("input", "lower", "upper", "rate"), "applied"),
    form=forms.INPUT,
    need=Need.INPUTS,
)
VERDICT = Row(
    key="verdict",
    name="/dgu_{j}/verdict",
    type_name="dcmg_msgs/msg/Verdict",
    codec=StepCodec.at,
    over=Over.MONITORS,
    publisher="monitor_{j}",
    says="which incoming links lie",
    readers=("dgu_{responding}",),
    frame="dgu_{j}",
    numbers={"monitor": "j"},
    form=forms.ISOLATION,
    need=Need.COMBINED,
)
ANNOUNCED = Row(
    key="announced",
    name="/dgu_{i}/inputs",
    type_name="dcmg_msgs/msg/Inputs",
    codec=StepCodec.at,
    over=Over.ANNOUNCING,
    publisher="dgu_{i}",
    says="what acts on a DGU, for members that do not hear it",
    readers=("monitor_{unaware}",),
    frame="dgu_{i}",
    numbers={"dgu": "i"},
    form=forms.ANNOUNCED,
    need=Need.TEAM,
)
ESTIMATE = Row(
    key="estimate",
    name="/dgu_{j}/estimate",
    type_name="dcmg_msgs/msg/TeamEstimate",
    codec=StepCodec.at,
    over=Over.DGUS,
    publisher="monitor_{j}",
    says="what a member of the team estimates of the grid, and whom it accuses",
    readers=("monitor_{neighbours}",),
    frame="dgu_{j}",
    numbers={"monitor": "j"},
    sequences={"alarm": "members", "estimate": "grid", "disagreement": "grid", "threshold": "grid"},
    form=forms.MEMBER,
    need=Need.TEAM,
)
SECOND = Row(
    key="second",
    name=f"{_RECEIVED}/second_publisher",
    type_name="dcmg_msgs/msg/Output",
    codec=StepCodec.at,
    over=Over.LINKS,
    publisher="attacker",
    says="what another publisher sent on a link, kept beside it in a bag",
    kind=TopicKind.EVENT,
    frame="dgu_{i}",
    numbers={"source": "i"},
    sequences=_SAMPLE,
    form=forms.OUTPUT,
    listed=False,
)
COMMANDS = Row(
    key="commands",
    name="/commands/events",
    type_name="dcmg_msgs/msg/CommandEvent",
    codec=CommandEventCodec.at,
    over=Over.RUN,
    publisher="clock",
    says="a command takes effect: clock, load, reference, detector, response",
    readers=("dgu_{all}", "monitor_{all}"),
    kind=TopicKind.EVENT,
    listed=False,
)
ATTACK_COMMANDS = Row(
    key="attack_commands",
    name="/attacks/commands",
    type_name="dcmg_msgs/msg/CommandEvent",
    codec=CommandEventCodec.at,
    over=Over.RUN,
    publisher="attacker",
    says="a command on attacks takes effect",
    kind=TopicKind.EVENT,
    listed=False,
)
ALARMS = Row(
    key="alarms",
    name="/dgu_{j}/alarms",
    type_name="dcmg_msgs/msg/Alarm",
    codec=AlarmCodec.at,
    over=Over.MONITORS,
    publisher="monitor_{j}",
    says="an alarm starts or ends",
    kind=TopicKind.EVENT,
    frame="dgu_{j}",
    sequences={"residual": "outputs", "threshold": "outputs"},
)
STREAM = Row(
    key="stream",
    name="/dgu_{j}/stream",
    type_name="dcmg_msgs/msg/StreamEvent",
    codec=StreamCodec.at,
    over=Over.MONITORS,
    publisher="monitor_{j}",
    says="the stream of a link stops, or starts again, being one publisher's in order",
    kind=TopicKind.EVENT,
    frame="dgu_{j}",
)
ATTACKS = Row(
    key="attacks",
    name="/attacks/events",
    type_name="dcmg_msgs/msg/AttackEvent",
    codec=AttackEventCodec.at,
    over=Over.RUN,
    publisher="attacker",
    says="an attack starts or stops",
    kind=TopicKind.EVENT,
)
DIAGNOSTICS = Row(
    key="diagnostics",
    name="/diagnostics",
    type_name="diagnostic_msgs/msg/DiagnosticArray",
    codec=DiagnosticsCodec.at,
    over=Over.MONITORS,
    publisher="monitor_{j}",
    says="health of a monitor's links, at whole simulated seconds",
    kind=TopicKind.EVENT,
    frame="dgu_{j}",
)
ACCUSATIONS = Row(
    key="accusations",
    name="/dgu_{j}/team_alarms",
    type_name="dcmg_msgs/msg/Alarm",
    codec=AlarmCodec.at,
    over=Over.DGUS,
    publisher="monitor_{j}",
    says="an accusation of a member of the team starts or ends",
    kind=TopicKind.EVENT,
    frame="dgu_{j}",
    sequences={"residual": "outputs", "threshold": "outputs"},
    need=Need.TEAM,
)
HISTORY = Row(
    key="history",
    name="/dgu_{i}/history",
    type_name="dcmg_msgs/msg/History",
    codec=HistoryCodec.at,
    over=Over.DGUS,
    publisher="dgu_{i}",
    says="offline experiments on a DGU",
    readers=("monitor_{hearing}", "monitor_{hosting}"),
    kind=TopicKind.LATCHED,
    frame="dgu_{i}",
)
DESIGN = Row(
    key="design",
    name="/dgu_{j}/design/dgu_{i}",
    type_name="dcmg_msgs/msg/Design",
    codec=DesignCodec.at,
    over=Over.LINKS,
    publisher="monitor_{j}",
    says="the observer of a link, or why there is none",
    kind=TopicKind.LATCHED,
    frame="dgu_{j}",
)
OWN_DESIGN = Row(
    key="own_design",
    name="/dgu_{j}/design/dgu_{i}",
    type_name="dcmg_msgs/msg/Design",
    codec=DesignCodec.at,
    over=Over.MONITORS,
    publisher="monitor_{j}",
    says="the observer of the own state",
    kind=TopicKind.LATCHED,
    frame="dgu_{j}",
    need=Need.LOCAL,
)
INPUT_DESIGN = Row(
    key="input_design",
    name="/dgu_{j}/input_design/dgu_{i}",
    type_name="dcmg_msgs/msg/Design",
    codec=DesignCodec.at,
    over=Over.LINKS,
    publisher="monitor_{j}",
    says="the estimator of the sender's inputs",
    kind=TopicKind.LATCHED,
    frame="dgu_{j}",
    need=Need.INPUTS,
)
GRID_HISTORY = Row(
    key="grid_history",
    name="/grid/history",
    type_name="dcmg_msgs/msg/History",
    codec=HistoryCodec.at,
    over=Over.RUN,
    publisher="dgu_{i}",
    says="the experiment on the whole grid; the first DGU publishes it",
    readers=("monitor_{all}",),
    kind=TopicKind.LATCHED,
    frame="dgu_0",
    need=Need.TEAM,
)
TEAM_DESIGN = Row(
    key="team_design",
    name="/dgu_{j}/design/grid",
    type_name="dcmg_msgs/msg/Design",
    codec=DesignCodec.at,
    over=Over.DGUS,
    publisher="monitor_{j}",
    says="the design of the team as a member found it",
    kind=TopicKind.LATCHED,
    frame="dgu_{j}",
    need=Need.TEAM,
)

TABLE: tuple[Row[Any], ...] = (
    *(CLOCK, TICK, STATE, OUTPUT, OWN, RECEIVED, RESIDUAL, OWN_RESIDUAL, INPUT, VERDICT, ANNOUNCED, ESTIMATE),
    *(COMMANDS, ATTACK_COMMANDS, SECOND, ALARMS, STREAM, ATTACKS, DIAGNOSTICS, ACCUSATIONS),
    *(HISTORY, DESIGN, OWN_DESIGN, INPUT_DESIGN, GRID_HISTORY, TEAM_DESIGN),
)


def with_conclusions(rows: Sequence[Row[Any]]) -> tuple[Row[Any], ...]:
    """Rows of a recorded run with those that its bag lacks and other monitors may fill, in canonical order."""
    order = {row.key: number for number, row in enumerate(TABLE)}
    there = {row.key for row in rows}
    missing = [row for row in TABLE if row.need is not Need.ALWAYS and row.key not in there]
    return tuple(sorted((*rows, *missing), key=lambda row: order.get(row.key, len(order))))
