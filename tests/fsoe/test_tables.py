"""What the state tables say of an end that does otherwise, at each turn of a clean run."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from campaign.lossy_links import make_link
from changed import compare, whole

from fsoe_net.campaign.channel import Way
from fsoe_net.campaign.collision_proof import block_crcs
from fsoe_net.campaign.departure import frame_text
from fsoe_net.campaign.tables import StateTable
from fsoe_net.fsoe.chain import reset_frame
from fsoe_net.fsoe.pdu import Command, Pdu, decode_pdu, frame_length

MS = 1_000_000


def _other_bytes(frame: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield frames that differ in one field, their CRCs as they are."""
    for command in (*Command, 0x55):
        if frame[0] != command:
            yield f"command {command:02x}", bytes((command,)) + frame[1:]
    yield "other data", frame[:1] + bytes((frame[1] ^ 1,)) + frame[2:]
    yield "other CRC", frame[:-3] + bytes((frame[-3] ^ 1,)) + frame[-2:]
    yield "other ConnID", frame[:-1] + bytes((frame[-1] ^ 1,))


def _sent(frame: bytes | None, size: int) -> Iterator[tuple[str, bytes | None]]:
    """Yield what an end could send instead of the right answer."""
    yield "the right answer", frame
    yield "a short frame", bytes(frame_length(size) - 1)
    for code in (0, 1, 4, 5, 9, 0x80):
        yield f"Reset {code}", reset_frame(code, size)
    yield "another Reset", b"\x2a\1" + bytes(frame_length(size) - 2)
    if frame is None:
        yield "a frame", b"\x36" + bytes(frame_length(size) - 1)
    else:
        yield "nothing", None
        yield from _other_bytes(frame)


def _refitted(table: StateTable, frame: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield frames that differ in one field, with all CRCs right."""
    for name, other in _other_bytes(frame):
        pdu = decode_pdu(other)
        crcs = block_crcs(table.last, table.due_sequence(pdu), pdu)
        yield f"{name}, CRCs made anew", pdu._replace(crcs=crcs).encode()


def _received(table: StateTable, frame: bytes | None) -> Iterator[tuple[str, bytes | None]]:
    """Yield what an end could receive instead, always answered with nothing."""
    if frame is not None:
        yield "a short frame", frame[:-1]
        yield "a Session that starts anew", bytes.fromhex("4e0000") + frame[3:]
        yield from _other_bytes(frame)
        yield from _refitted(table, frame)


@pytest.mark.weekly
@pytest.mark.shows("R17")
@pytest.mark.parametrize("sizes", [(2, 2), (1, 2), (4, 1)], ids=str)
@pytest.mark.parametrize("foreign", [False, True])
def test_each_change_of_what_an_end_does(sizes: tuple[int, int], foreign: bool) -> None:
    channel = make_link(*sizes, app=b"\1\2\3").channel(3)
    for table in channel.tables:
        table.grace_ns = MS * foreign
    rows: list[tuple[str, str]] = []
    data_turns = 0
    while data_turns < 4:
        way = channel.way
        table, before = channel.tables[way], channel.tables[way].snapshot()
        now_ns = channel.now_ns
        image, answer = channel.turn()
        assert channel.departed is None
        after = table.snapshot()
        where = f"{way.name} in {before['state'].value}"

        def tried(what: str, *call, where=where, table=table, before=before, after=after) -> None:
            table.restore(before | {"enabled": after["enabled"]})
            found = table.call(*call)
            rows.append((f"{len(rows)} {where}, {what}", f"{found} then {table.snapshot()}"))

        table.restore(before)
        inputs = list(_received(table, image)) if answer is not None else []
        for what, other in _sent(answer, channel.sizes[1 - way]):
            tried(f"sends {what}", now_ns, image, other)
        for late_ns in (19 * MS - 1, 19 * MS, 20 * MS - 1, 20 * MS, 21 * MS - 1, 21 * MS):
            if before["start_ns"] is not None:
                at_ns = before["start_ns"] + late_ns
                tried(f"silent {late_ns} ns", at_ns, before["seen"], None)
                reset = reset_frame(5, channel.sizes[1 - way])
                tried(f"Reset 5 after {late_ns} ns", at_ns, before["seen"], reset)
        for what, other in inputs:
            tried(f"reads {what}", now_ns, other, None)
        table.restore(after)
        data_turns += before["state"].value == "Data"
    compare(__file__, f"tables {sizes[0]}x{sizes[1]} {'foreign' if foreign else 'ours'}", rows)


@pytest.mark.parametrize("way", list(Way))
def test_values_for_the_application(way: Way) -> None:
    rows = []
    channel = make_link().channel(3)
    for turns in (3, 60):
        for _ in range(turns):
            channel.turn()
        table = channel.tables[way]
        for blind in (False, True):
            table.blind = blind
            for valid in (False, True):
                for data in (b"\0\0", b"\1\0", table.data):
                    found = table.shows(valid=valid, data=data)
                    rows.append((f"{turns} {blind} {valid} {data.hex()}", whole(found)))
        table.blind = False
    compare(__file__, f"application {way.name}", rows)


def _session(data: bytes, last: int) -> Pdu:
    pdu = decode_pdu(bytes((Command.SESSION,)) + bytes(frame_length(len(data)) - 1))
    pdu = pdu._replace(safe_data=data)
    return pdu._replace(crcs=block_crcs(last, 1, pdu))


@pytest.mark.parametrize("size", [1, 2])
def test_session_ids_that_repeat(size: int) -> None:
    rows = []
    table = make_link(size, size).channel(1).tables[Way.TO_SUB]
    for n in range(7):
        opening = _session(bytes((n, *bytes(size - 1))), 0)
        answer = _session(b"\7" + bytes(size - 1), opening.crcs[0])
        found = table.call(0, opening.encode(), answer.encode())
        rows.append((f"{n}", f"{whole(found)} {table.same_ids}"))
    compare(__file__, f"same ids of {size} bytes", rows)


def test_frames_in_messages() -> None:
    assert frame_text(None) == "nothing"
    assert frame_text(b"\1\2\3") == "010203"
    assert frame_text(bytes(60)) == "00" * 60
    assert frame_text(bytes(61)) == "00" * 60 + "... (61 bytes)"
    whole = frame_text(bytes(15))
    assert whole == "command 0x00 00 00 00 00 00 00 ConnID 0 CRC 0000 0000 0000"
    whole = frame_text(bytes(255))
    assert whole == f"command 0x00{' 00' * 36}... (255 bytes)"
