"""A network as one static page, with the content of the studio page, for a fault report."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.diag.words import counted, listed, summary
from fsoe_net.document.model import (
    Cell,
    Column,
    Document,
    Item,
    Level,
    Part,
    Picture,
    Section,
    Table,
    Verdict,
    cell,
    code,
    muted,
    number_of,
    stated,
    strong,
)
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.project.check import Checked
from fsoe_net.report.model import LEVELS
from fsoe_net.report.network_picture import network_picture
from fsoe_net.report.robot_boxes import End, EndState, RobotGraph, robot_graph
from fsoe_net.report.robot_picture import robot_picture
from fsoe_net.version import __version__

_FILE = "network file"


def snapshot(checked: Checked, path: str) -> Document:
    """Return bus, slots, connections and findings of a network, even if it has errors.

    Args:
        checked: The network, with everything found in it.
        path: Its file, as named by the user.
    """
    found, resolution = checked.diagnostics, checked.resolution
    worst = min((d.level for d in found), key=lambda level: level.rank, default=None)
    verdict = Verdict("No findings", Level.NOTE)
    if worst is not None:
        verdict = Verdict(summary(found), LEVELS[worst])
    sections = [Section(key="findings", title="Findings", parts=(_findings(found),))]
    if resolution is not None:
        sections = [
            Section(key="bus", title="Bus", parts=_bus(checked, resolution)),
            Section(key="slots", title="Slots", parts=(_slots(resolution),)),
            Section(key="connections", title="Connections", parts=(_connections(resolution),)),
            *sections,
        ]
        graph = robot_graph(resolution, found)
        if graph.components:
            sections.insert(0, Section(key="robot", title="Robot", parts=_robot(graph)))
    return Document(
        title=resolution.network.name if resolution is not None else path,
        subtitle=f"snapshot of {path}",
        version=__version__,
        verdict=verdict,
        sections=tuple(sections),
        foot="part of the black channel, not certified, never a safety function",
    )


def _robot(graph: RobotGraph) -> tuple[Part, ...]:
    channels = {line.left: line.right for line in graph.bindings}
    claimed: dict[tuple[int, int], dict[str, None]] = {}
    for line in graph.claims:
        claimed.setdefault(line.right, {})[graph.controllers[line.left[0]].name] = None
    rows = []
    for n, box in enumerate(graph.components):
        for m, end in enumerate(box.ends):
            bound = channels.get((n, m))
            row = (
                cell(strong(box.name)),
                cell(end.name),
                cell("command" if end.is_command else "state"),
                cell(listed([*claimed.get((n, m), ())]) or muted("none")),
                cell(_channel(graph, end, bound)),
            )
            rows.append(row)
    names = ("Component", "Interface", "Side", "Controllers", "Channel")
    table = Table(name="interfaces", columns=tuple(map(Column, names)), rows=tuple(rows))
    return Picture(title="Robot", words=graph.words, svg=robot_picture(graph)), table


def _channel(graph: RobotGraph, end: End, bound: tuple[int, int] | None) -> Item | str:
    if bound is not None:
        sub = graph.subdevices[bound[0]]
        return f"{sub.name} {sub.ends[bound[1]].at}"
    return Verdict("unbound", Level.ERROR) if end.state is EndState.WRONG else muted("none")


def _bus(checked: Checked, resolution: Resolution) -> tuple[Part, ...]:
    rows = tuple(
        (
            cell(stated(sub.position, "", "on the bus")),
            cell(strong(sub.name)),
            cell(stated(sub.alias, "", _FILE)) if sub.alias else (),
            cell(
                muted("not known")
                if sub.device is None
                else f"vendor 0x{sub.device.vendor_id:08x}, product 0x{sub.device.product_code:08x}"
            ),
        )
        for sub in resolution.network.subdevices
    )
    columns = (Column("Position", number=True), Column("SubDevice"), Column("Alias", number=True))
    table = Table(name="bus", columns=(*columns, Column("Device")), rows=rows)
    text = (
        f"{counted(len(resolution.network.subdevices), 'SubDevice')}, "
        f"{counted(len(resolution.connections), 'FSoE connection')}; one with an error, or not "
        "confirmed, is dotted and has a cross"
    )
    svg = network_picture(resolution, checked.diagnostics)
    return Picture(title="Network", words=text, svg=svg), table


def _slots(resolution: Resolution) -> Table:
    partners: dict[tuple[str, int | None], str] = {}
    for c in resolution.connections:
        partners[c.main.name, c.slot] = c.sub.name
        partners[c.sub.name, c.sub_slot] = c.main.name
    rows: list[tuple[Cell, ...]] = []
    for sub in resolution.network.subdevices:
        for pair in () if sub.layout is None else sub.layout.frame_pairs:
            partner = partners.get((sub.name, pair.slot))
            taken = 0 if pair.takes is None else pair.takes.frame_bytes
            row = (
                cell(sub.name),
                cell(stated(pair.slot, "", "process data")),
                cell(number_of(pair.sent_bytes, "byte", "process data")),
                cell(number_of(taken, "byte", "process data")),
                cell(f"with {partner}" if partner else muted("free")),
            )
            rows.append(row)
    numbers = (Column(title, number=True) for title in ("Slot", "Sends", "Takes"))
    columns = (Column("SubDevice"), *numbers, Column("Connected"))
    return Table(name="slots", columns=columns, rows=tuple(rows))


def _connections(resolution: Resolution) -> Table:
    columns = (
        Column("Connection"),
        Column("ConnID", number=True),
        Column("FSoE address", number=True),
        Column("FSoE watchdog", number=True),
        Column("State"),
    )
    return Table(name="connections", columns=columns, rows=tuple(map(_row, resolution.connections)))


def _row(connection: Connection) -> tuple[Cell, ...]:
    facts = connection.stated
    state: Verdict | str = "confirmed"
    if facts.unconfirmed is not None:
        state = Verdict(f"not confirmed: {facts.unconfirmed}", Level.OPEN)
    return (
        cell(strong(f"{connection.main.name} → {connection.sub.name}")),
        _stated(facts.connection_id),
        _stated(facts.address),
        _stated(facts.watchdog_ms, "ms"),
        cell(state),
    )


def _stated(value: int | None, unit: str = "") -> Cell:
    return cell(muted("not stated") if value is None else stated(value, unit, _FILE))


def _findings(found: list[Diagnostic]) -> Table:
    rows = tuple(
        (
            cell(Verdict(d.level.value, LEVELS[d.level]), code(d.code)),
            cell(d.message, muted(d.hint)),
            cell(code(str(d.span))),
        )
        for d in found
    )
    columns = (Column("Finding"), Column("What is wrong, and the next step"), Column("Place"))
    return Table(name="findings", columns=columns, rows=rows)
