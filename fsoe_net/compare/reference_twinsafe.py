"""FSN443, FSN446, FSN447: connections of a network against a safety project."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import FindingList, Related, Span
from fsoe_net.diag.words import counted
from fsoe_net.model.description import DescribedConnection, Description
from fsoe_net.model.library import Library, LibraryDevice
from fsoe_net.model.resolve import Connection, Resolution

_HINT = "the logic runs with its safety project: write its value here, or change the project"


@dataclass(frozen=True, slots=True)
class _Project:
    """A safety project and the connections of one MainInstance."""

    out: FindingList
    resolution: Resolution
    file: Description
    library: Library

    def order(self, row: DescribedConnection) -> str:
        """Order number of the SubInstance of a row."""
        return "" if row.sub is None else self.file.subdevices[row.sub].order

    def title(self, row: DescribedConnection) -> str:
        """``connection 2 (EL1904, FSoE address 5)``, without a number where the file has none."""
        known = [self.order(row) or row.name[:60]]
        if row.address is not None:
            known.append(f"FSoE address {row.address}")
        number = "" if row.slot is None else f" {row.slot + 1}"
        return f"connection{number} ({', '.join(k for k in known if k)})"

    def device(self, connection: Connection) -> LibraryDevice | None:
        """Library device of the SubInstance."""
        device = connection.sub.device
        if device is None:
            return None
        return self.library.find(device.vendor_id, device.product_code)

    def another(self, connection: Connection, row: DescribedConnection) -> bool:
        """Whether both are known to be different devices."""
        mine = self.device(connection)
        other = self.library.named(self.order(row)) if self.order(row) else None
        return mine is not None and other is not None and mine is not other


def check_twinsafe(
    out: FindingList,
    resolution: Resolution,
    file: Description,
    library: Library,
    *,
    slots: bool = True,
) -> None:
    """Compare slot order, FSoE address, connection ID, watchdog and parameters.

    Args:
        out: Takes the findings.
        resolution: The network.
        file: The export.
        library: States which device an order number is.
        slots: Whether to compare the order of slots; `check_slots` does it for a whole bus.
    """
    project = _Project(out, resolution, file, library)
    # Connections in which the logic is itself the SubInstance are in another network.
    rows = [c for c in file.connections if c.main == 0]
    ours = _of_main(resolution, rows)
    if not ours and resolution.network.partial:
        return  # the transfers are in a file that was not given
    if file.connections and not rows:
        return
    if not rows or not ours:
        why = "it has no connections" if not rows else "the network has no FSoE connection"
        _nothing(out, resolution, f"{file.path}: {why}", "is this the safety project you mean?")
        return
    numbers = _pairs(project, ours, rows)
    if not numbers:
        what = f"{file.path}, which has {counted(len(rows), 'connection')}"
        _nothing(out, resolution, what, "is this the safety project of another machine?")
        return
    _missing(project, ours, rows, numbers)
    pairs = [(ours[number], rows[other]) for number, other in numbers.items()]
    whole = len(pairs) == len(ours) == len(rows)
    if slots:
        _slots(project, pairs, whole=whole)
    for connection, row in pairs:
        _values(project, connection, row)


def _nothing(out: FindingList, resolution: Resolution, where: str, hint: str) -> None:
    text = f"no SubDevice of this network is in {where}"
    out.add("FSN443", resolution.network.span, text, hint=hint)


_Pairs = list[tuple[Connection, DescribedConnection]]


def _of_main(resolution: Resolution, rows: list[DescribedConnection]) -> list[Connection]:
    """Return the connections of the MainInstance whose facts agree most with the project."""
    ids = {r.connection_id for r in rows} - {None}
    addresses = {r.address for r in rows} - {None}
    score: Counter[str] = Counter()
    for c in resolution.connections:
        score[c.main.name] += 1
        if c.facts is not None:
            score[c.main.name] += 1000 * (c.facts.connection_id in ids)
            score[c.main.name] += 1000 * (c.facts.address in addresses)
    if not score:
        return []
    main = score.most_common(1)[0][0]
    return [c for c in resolution.connections if c.main.name == main]


def _pairs(
    project: _Project, ours: list[Connection], rows: list[DescribedConnection]
) -> dict[int, int]:
    """Pair by connection ID and address, then by one of them, then by slot.

    Returns:
        The number of the row for that of the connection, in the order of the connections.
    """
    left, free = dict(enumerate(ours)), dict(enumerate(rows))
    pairs: dict[int, int] = {}

    def pair(number: int, other: int | None) -> None:
        if other is not None and not project.another(ours[number], rows[other]):
            pairs[number] = other
            del left[number], free[other]

    def by(keys: tuple[str, ...]) -> None:
        waiting: dict[tuple[object, ...], int] = {}
        for other, row in free.items():
            values = tuple(getattr(row, k) for k in keys)
            if None not in values:
                waiting.setdefault(values, other)
        for number, c in list(left.items()):
            values = tuple(getattr(c.facts, k, None) for k in keys)
            if None not in values:
                pair(number, waiting.pop(values, None))

    by(("connection_id", "address"))
    by(("address",))
    by(("connection_id",))
    by_slot = {row.slot: other for other, row in free.items() if row.slot is not None}
    for number, c in list(left.items()):
        if c.slot is not None:
            pair(number, by_slot.pop(c.slot, None))
    return dict(sorted(pairs.items()))


def _missing(
    project: _Project,
    ours: list[Connection],
    rows: list[DescribedConnection],
    pairs: dict[int, int],
) -> None:
    """FSN447."""
    for number, c in enumerate(ours):
        if number not in pairs:
            project.out.add(
                "FSN447",
                _place(c, "main"),
                f"the connection of {c.main.name} with {c.sub.name} is not in {project.file.path}",
                hint="add it to the safety project, or take its transfers out here",
                related=(Related(span=project.file.span, message="the safety project"),),
            )
    if project.resolution.single or any(n.incomplete for n in project.resolution.network.nets):
        return  # a transfer is missing here, which has a finding of its own
    there = set(pairs.values())
    for number, row in enumerate(rows):
        if number not in there:
            project.out.add(
                "FSN447",
                ours[0].net.span,
                f"{project.title(row)} of {project.file.path} has no transfers here",
                hint="add its two transfers, or delete it in the safety project: the logic waits "
                "for each of its connections",
                related=(Related(span=row.span, message="the connection there"),),
            )


def _place(connection: Connection, key: str) -> Span:
    facts = connection.facts
    return connection.to_sub.transfer.span if facts is None else facts.at(key)


def _slots(project: _Project, pairs: _Pairs, *, whole: bool) -> None:
    """Compare the order of slots; a missing one, which is reported, moves the others."""
    rows = sorted(
        (
            (c.slot, row.slot, c, row)
            for c, row in pairs
            if c.slot is not None and row.slot is not None
        ),
        key=lambda item: item[0],
    )
    wanted = sorted(there for _, there, _, _ in rows)
    wrong = {
        slot: (there, c, row)
        for (slot, there, c, row), in_order in zip(rows, wanted, strict=True)
        if there != slot and (whole or there != in_order)
    }
    for slot, (there, c, row) in list(wrong.items()):
        if slot not in wrong:
            continue  # reported with its partner
        text = f"{c.main.name} with {c.sub.name} uses slot {slot}, slot {there}"
        partner = wrong.get(there)
        if partner is not None and partner[0] == slot:
            del wrong[there]
            text += f" in {project.file.path}; {partner[1].sub.name} the other way round"
        else:
            text += f" in {project.file.path}"
        project.out.add(
            "FSN446",
            _place(c, "slot"),
            text,
            hint="the n-th connection of the project is the n-th frame pair of the logic: put the "
            "transfers to that pair, or change the order in the project",
            related=(Related(span=row.span, message="the connection there"),),
        )


def _values(project: _Project, connection: Connection, row: DescribedConnection) -> None:
    facts = connection.facts
    title = f"{connection.main.name} with {connection.sub.name}"
    for key, words, unit, name in (
        ("address", "FSoE address", "", "SAddress"),
        ("connection_id", "connection ID", "", "ConId"),
        ("watchdog_ms", "FSoE watchdog", " ms", "SWatchdog"),
    ):
        mine, other = getattr(facts, key, None), getattr(row, key)
        if mine is not None and other is not None and mine != other:
            _differ(
                project, connection, row, key, name, f"{title}: {words} {mine}{unit}, {other}{unit}"
            )
    if facts is not None and facts.app_parameters and row.app_parameters:
        own, there = facts.app_parameters, row.app_parameters
        if own != there:
            text = f"{title}: parameters {own.hex(' ')}, {there.hex(' ')}"
            _differ(project, connection, row, "app_parameters", "SafeUserPara", text)


def _differ(
    project: _Project,
    connection: Connection,
    row: DescribedConnection,
    key: str,
    name: str,
    text: str,
) -> None:
    project.out.add(
        "FSN446",
        _place(connection, key),
        f"{text} in {project.file.path}",
        hint=_HINT,
        related=(Related(span=row.at(name), message="the value there"),),
    )
