"""FSN443, FSN446, FSN447: connections of a network compared with a safety project."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from fsoe_net.compare.pairing import VALUES, attributes, differing, pair_by, pair_connections
from fsoe_net.diag.diagnostic import FindingList, Related, Span
from fsoe_net.diag.words import counted
from fsoe_net.model.described_network import described_connections
from fsoe_net.model.description import DescribedConnection, Description
from fsoe_net.model.library import Library
from fsoe_net.model.resolve import Connection, Resolution

_Pair = tuple[Connection, DescribedConnection]


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
        library: Maps order numbers to devices.
        slots: Whether to compare the order of slots; `check_slots` does it for a whole bus.
    """
    project = _Project(out, resolution, file, library)
    # Connections in which the logic itself is the SubInstance belong to another network.
    rows = [c for c in file.connections if c.main == 0]
    ours = _of_main(resolution, rows)
    if not ours and resolution.network.partial:
        return  # the transfers are in a file that was not given
    if file.connections and not rows:
        return
    if not rows or not ours:
        why = "it has no connections" if not rows else "the network has no FSoE connection"
        project.add_nothing(f": {why}", "is this the safety project you mean?")
        return
    numbers = project.pair(ours, rows)
    if not numbers:
        what = f", which has {counted(len(rows), 'connection')}"
        project.add_nothing(what, "is this the safety project of another machine?")
        return
    project.check_missing(ours, rows, numbers)
    pairs = [(ours[number], rows[other]) for number, other in numbers.items()]
    if slots:
        project.check_slots(pairs, whole=len(pairs) == len(ours) == len(rows))
    for connection, row in pairs:
        project.check_values(connection, row)


def _of_main(resolution: Resolution, rows: list[DescribedConnection]) -> list[Connection]:
    """Return the connections of the MainInstance that matches the project best."""
    ids = {r.connection_id for r in rows} - {None}
    addresses = {r.address for r in rows} - {None}
    score: Counter[str] = Counter()
    for c in resolution.connections:
        equal = (c.stated.connection_id in ids) + (c.stated.address in addresses)
        score[c.main.name] += 1 + 1000 * equal
    main = max(score, key=score.__getitem__, default="")
    return [c for c in resolution.connections if c.main.name == main]


def _place(connection: Connection, key: str) -> Span:
    facts = connection.facts
    return connection.to_sub.transfer.span if facts is None else facts.at(key)


@dataclass(frozen=True, slots=True)
class _Project:
    """A safety project and the connections of one MainInstance."""

    out: FindingList
    resolution: Resolution
    file: Description
    library: Library

    def order(self, row: DescribedConnection) -> str:
        """Return the order number of the SubInstance of a row."""
        return "" if row.sub is None else self.file.subdevices[row.sub].order

    def title(self, row: DescribedConnection) -> str:
        """Return ``connection 2 (EL1904, FSoE address 5)``; the number only if it is known."""
        parts = [self.order(row) or row.name[:60]]
        if row.address is not None:
            parts.append(f"FSoE address {row.address}")
        number = "" if row.slot is None else f" {row.slot + 1}"
        return f"connection{number} ({', '.join(p for p in parts if p)})"

    def add_nothing(self, why: str, hint: str) -> None:
        """FSN443."""
        text = f"no SubDevice of this network is in {self.file.path}{why}"
        self.out.add("FSN443", self.resolution.network.span, text, hint=hint)

    def pair(self, ours: list[Connection], rows: list[DescribedConnection]) -> dict[int, int]:
        """Pair by connection ID and address, then by one of them, then by slot.

        Returns:
            The number of the row by the number of the connection, in the order of the connections.
        """
        both = zip(described_connections(self.resolution), self.resolution.connections, strict=True)
        left = dict(enumerate(d for d, c in both if c.main.name == ours[0].main.name))
        right = dict(enumerate(rows))

        def fits(mine: DescribedConnection, row: DescribedConnection) -> bool:
            """Whether the two may be the same device."""
            if mine.sub is None:
                return True
            device = self.resolution.network.subdevices[mine.sub].device
            order = self.order(row)
            if device is None or not order:
                return True
            known = self.library.find(*device.identity)
            other = self.library.named(order)
            return known is None or other is None or known is other

        pairs = pair_connections(left, right, fits)
        pairs += pair_by(attributes("slot"), left, right, fits=fits)
        return dict(sorted(pairs))

    def check_missing(
        self, ours: list[Connection], rows: list[DescribedConnection], pairs: dict[int, int]
    ) -> None:
        """FSN447."""
        for number, c in enumerate(ours):
            if number not in pairs:
                self.out.add(
                    "FSN447",
                    _place(c, "main"),
                    f"the connection of {c.main.name} with {c.sub.name} is not in {self.file.path}",
                    hint="add it to the safety project, or take its transfers out here",
                    related=(Related(span=self.file.span, message="the safety project"),),
                )
        if self.resolution.single or any(n.incomplete for n in self.resolution.network.nets):
            return  # a transfer is missing here, which has its own finding
        there = set(pairs.values())
        for number, row in enumerate(rows):
            if number not in there:
                self.out.add(
                    "FSN447",
                    ours[0].net.span,
                    f"{self.title(row)} of {self.file.path} has no transfers here",
                    hint="add its two transfers, or delete it in the safety project: the logic "
                    "waits for each of its connections",
                    related=(Related(span=row.span, message="the connection there"),),
                )

    def check_slots(self, pairs: list[_Pair], *, whole: bool) -> None:
        """Compare the order of slots; a missing one is reported and shifts the others."""
        rows = sorted(
            (
                (c.slot, row.slot, c, row)
                for c, row in pairs
                if c.slot is not None and row.slot is not None
            ),
            key=lambda item: item[0],
        )
        in_order = sorted(there for _, there, _, _ in rows)
        wrong = {
            slot: (there, c, row)
            for (slot, there, c, row), expected in zip(rows, in_order, strict=True)
            if there != slot and (whole or there != expected)
        }
        for slot, (there, c, row) in list(wrong.items()):
            if slot not in wrong:
                continue  # reported together with its partner
            text = f"{c.main.name} with {c.sub.name} uses slot {slot}, slot {there} in "
            text += self.file.path
            partner = wrong.get(there)
            if partner is not None and partner[0] == slot:
                del wrong[there]
                text += f"; {partner[1].sub.name} the other way round"
            self.out.add(
                "FSN446",
                _place(c, "slot"),
                text,
                hint="the n-th connection of the project is the n-th frame pair of the logic: put "
                "the transfers to that pair, or change the order in the project",
                related=(Related(span=row.span, message="the connection there"),),
            )

    def check_values(self, connection: Connection, row: DescribedConnection) -> None:
        """Compare the values of a connection that both sides state."""
        facts = connection.stated
        for value in VALUES:
            if both := differing(value, facts, row):
                mine, other = (f"{number}{value.unit}" for number in both)
                self._add_value(
                    connection, row, value.key, value.tag, f"{value.what} {mine}, {other}"
                )
        own, there = facts.app_parameters, row.app_parameters
        if own and there and own != there:
            text = f"parameters {own.hex(' ')}, {there.hex(' ')}"
            self._add_value(connection, row, "app_parameters", "SafeUserPara", text)

    def _add_value(
        self, connection: Connection, row: DescribedConnection, key: str, tag: str, text: str
    ) -> None:
        self.out.add(
            "FSN446",
            _place(connection, key),
            f"{connection.main.name} with {connection.sub.name}: {text} in {self.file.path}",
            hint="the logic runs with its safety project: write its value here, or change the "
            "project",
            related=(Related(span=row.at(tag), message="the value there"),),
        )
