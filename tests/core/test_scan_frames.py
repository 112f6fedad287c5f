"""Connections found in captured traffic: by structure alone, and nothing where there is none."""

import random

import pytest
from capture.traffic import FPRD, LRD, LRW, LWR, MAC, Bus, datagram, packet
from capture_file import read_capture
from data_files import listed, need
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.core.scan import Scanner
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.pdu import Command, frame_length

SIZES = [(1, 1), (2, 2), (1, 6), (6, 1), (4, 14), (14, 14), (2, 1)]


def run(bus, cycles, scanner=None, wrap=None, start=0):
    """Feed cycles of a bus; return the scanner and all sightings."""
    scanner = scanner or Scanner()
    wrap = wrap or (lambda data: packet(datagram(LRW, 0x1000, data, 3)))
    seen = []
    for cycle in range(start, start + cycles):
        seen += scanner.packet(wrap(bus.image()), cycle * 1_000_000)
    return scanner, seen


@pytest.mark.parametrize(("out", "inn"), SIZES)
@pytest.mark.parametrize("noise", [False, True])
def test_start_up_is_found_whole(out, inn, noise):
    bus = Bus(out, inn, noise=noise)
    scanner, seen = run(bus, 100)
    (found,) = scanner.connections()
    assert found.connection_id == 7
    assert found.roles_certain
    assert found.state is ConnectionState.DATA_PROCESS
    assert found.gaps == 0
    assert {s.verdict for s in seen} == {CrcVerdict.RIGHT}
    # The first packet only shows what was there before; from then on every frame is there once.
    assert [(s.direction, s.frame) for s in seen] == bus.sent[-len(seen) :]
    assert len(seen) >= len(bus.sent) - 2
    assert {s.frame[0] for s in seen} >= {0x4E, 0x64, 0x52, 0x36}


@pytest.mark.parametrize(("out", "inn"), SIZES)
@pytest.mark.parametrize("noise", [False, True])
def test_running_connection_is_found(out, inn, noise):
    """No start-up in the capture: after a few frames the chain is known."""
    bus = Bus(out, inn, noise=noise)
    for _ in range(61):
        bus.image()
    before = len(bus.sent)
    scanner, seen = run(bus, 100)
    (found,) = scanner.connections()
    assert found.connection_id == 7
    assert not found.roles_certain
    ways = {(s.direction, s.frame) for s in seen}
    assert ways <= set(bus.sent[before - 2 :])
    assert all(s.verdict is not CrcVerdict.WRONG for s in seen)
    assert all(s.verdict is CrcVerdict.RIGHT for s in seen[8:])
    assert all(s.sequence for s in seen[8:])


@pytest.mark.uncounted
@pytest.mark.parametrize(("out", "inn"), SIZES)
@pytest.mark.parametrize("quick", [(), (0,), (1,), (0, 1)])
@pytest.mark.parametrize("joined", [0, 61, 62, 63, 64])
def test_a_connection_is_checked_whichever_end_answers_within_a_packet(out, inn, quick, joined):
    """Only places of one MainDevice's interface are seen: the answer to a copy, beside the copy."""
    for seen_at in ((0, 3), (1, 2), (0, 1), (2, 3), (0, 1, 2, 3)):
        bus = Bus(out, inn, noise=False, quick=quick)
        places = (bus.main_at, bus.sub_at, bus.main_copy_at, bus.sub_copy_at)
        sizes = [frame_length(out), frame_length(inn)] * 2
        for _ in range(joined):
            bus.image()

        def wrap(data, places=places, seen_at=seen_at, sizes=sizes):
            image = bytearray(len(data))
            for place in seen_at:
                part = slice(places[place], places[place] + sizes[place])
                image[part] = data[part]
            return packet(datagram(LRW, 0x1000, bytes(image), 3))

        scanner, sightings = run(bus, 120, wrap=wrap)
        (found,) = scanner.connections()
        assert found.connection_id == 7
        verdicts = [s.verdict for s in sightings]
        assert CrcVerdict.WRONG not in verdicts
        assert verdicts.count(CrcVerdict.UNCHECKED) <= 8
        assert verdicts.count(CrcVerdict.RIGHT) > 40


def test_places_and_copies_are_named():
    scanner, _ = run(Bus(6, 6), 120)
    (found,) = scanner.connections()
    places = {(p.address - 0x1000, p.direction, p.command) for p in found.places}
    assert places == {(20, 0, "LRW"), (60, 1, "LRW"), (100, 0, "LRW"), (150, 1, "LRW")}


def test_roles_are_corrected_by_a_start_up():
    bus = Bus(2, 2)
    for _ in range(61):
        bus.image()
    while bus.sub._seen != bus.inputs[0]:
        bus.image()
    # As after enough collisions: the numbers of the main are behind those of the sub.
    bus.main._chain.tx_sequence -= 2
    bus.sub._chain.rx_sequence -= 2
    scanner, _ = run(bus, 40)
    (found,) = scanner.connections()
    assert not found.roles_certain
    assert {p.address - 0x1000 for p in found.places if p.direction == 0} == {60, 150}
    bus.main.request_reset()
    _, seen = run(bus, 40, scanner, start=40)
    (found,) = scanner.connections()
    assert found.roles_certain
    assert {p.address - 0x1000 for p in found.places if p.direction == 0} == {20, 100}
    assert {s.verdict for s in seen} == {CrcVerdict.RIGHT}
    sessions = [s for s in seen if s.frame[0] == Command.SESSION]
    assert sessions[0].direction == 0


@pytest.mark.parametrize(
    "wrap",
    [
        lambda data: packet(datagram(LRW, 0, data, 3), vlan=True),
        lambda data: packet(datagram(LRW, 0, data, 3), udp=True),
        lambda data: packet(datagram(LWR, 0, data[:50], 1, True), datagram(LRD, 50, data[50:], 1)),
        lambda data: packet(datagram(FPRD, 0x1100_0000 | 1001, data, 1)),
        lambda data: packet(datagram(7, 0x130_0000, b"\0\0", 4, True), datagram(LRW, 0, data, 3)),
    ],
    ids=["vlan", "udp", "LWR and LRD", "physical", "second datagram"],
)
def test_every_way_of_carrying_process_data(wrap):
    scanner, seen = run(Bus(2, 4), 80, wrap=wrap)
    assert len(scanner.connections()) == 1
    assert {s.verdict for s in seen} == {CrcVerdict.RIGHT}


def test_frames_on_their_way_out_are_left_out():
    """Outgoing datagrams hold old or no inputs; taken in, they look like going back."""
    bus, scanner, seen = Bus(2, 2), Scanner(), []
    for cycle in range(80):
        image = bus.image()
        stale = image[:60] + bytes(7) + image[67:]
        seen += scanner.packet(packet(datagram(LRW, 0, stale, 0)), 2 * cycle)
        seen += scanner.packet(packet(datagram(LRW, 0, image, 3)), 2 * cycle + 1)
    assert {s.verdict for s in seen} == {CrcVerdict.RIGHT}
    assert scanner.counts().unanswered == 80


def test_many_connections_at_once():
    buses = [Bus(*SIZES[n % 7], connection_id=n + 1, seed=n) for n in range(20)]
    scanner = Scanner()
    for cycle in range(120):
        image = b"".join(bus.image() for bus in buses)
        parts = [image[at : at + 1400] for at in range(0, len(image), 1400)]
        for n, part in enumerate(parts):
            scanner.packet(packet(datagram(LRW, 1400 * n, part, 3)), cycle * 1_000_000)
    assert sorted(c.connection_id for c in scanner.connections()) == list(range(1, 21))
    assert all(len(c.places) == 4 for c in scanner.connections())


@pytest.mark.parametrize("before", [0, 61])
@pytest.mark.parametrize("size", [(1, 1), (2, 2), (4, 2)])
def test_frames_side_by_side_do_not_hide_each_other(size, before):
    """As in the process data of a main terminal: what stands behind a frame is the next one."""
    buses = [Bus(*size, connection_id=n + 1, seed=n, noise=False) for n in range(40)]
    length = [frame_length(n) for n in size]
    scanner = Scanner()
    for cycle in range(before + 200):
        images = [bus.image() for bus in buses]
        ends = [(buses[0].main_at, length[0]), (buses[0].sub_copy_at, length[1])]
        parts = [b"".join(image[at : at + n] for image in images) for at, n in ends]
        if cycle >= before:
            both = [datagram(LRW, 0x1000 * (n + 1), parts[n], 3, more=n == 0) for n in range(2)]
            scanner.packet(packet(*both), cycle * 1_000_000)
    found = scanner.connections()
    assert sorted(c.connection_id for c in found) == list(range(1, 41))
    assert {len(c.places) for c in found} == {2}
    assert {c.state for c in found} == {ConnectionState.DATA_PROCESS}


def test_a_damaged_frame_is_shown_where_it_is():
    bus, scanner, seen = Bus(2, 2, noise=False), Scanner(), []
    for cycle in range(100):
        image = bytearray(bus.image())
        if cycle == 71:
            image[60 + 3] ^= 0x10
        seen += scanner.packet(packet(datagram(LRW, 0, bytes(image), 3)), cycle * 1_000_000)
    wrong = [s for s in seen if s.verdict is CrcVerdict.WRONG]
    assert [(s.packet, s.direction) for s in wrong] == [(72, 1)]


def test_gap_in_the_capture_is_not_a_fault():
    bus = Bus(2, 2)
    scanner, _ = run(bus, 60)
    for _ in range(11):
        bus.image()
    run(bus, 60, scanner, start=71)
    (found,) = scanner.connections()
    assert found.gaps == 1
    assert found.to_sub.wrong + found.to_main.wrong <= 1


# -- where nothing is ---------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["random", "counters", "commands", "constant", "frozen frames"])
def test_nothing_is_found_where_nothing_is(kind):
    rng, scanner = random.Random(kind), Scanner()
    commands = [int(c) for c in Command]
    bus = Bus(2, 2)
    for _ in range(61):
        bus.image()
    frozen = bus.image()
    for cycle in range(3000):
        if kind == "random":
            data = rng.randbytes(300)
        elif kind == "counters":
            data = b"".join((cycle * k & 0xFFFF).to_bytes(2, "little") for k in range(150))
        elif kind == "commands":
            # Only bytes that are commands, and ConnID fields that never change.
            data = b"".join(
                bytes((rng.choice(commands),)) + rng.randbytes(4) + b"\7\0" * 4 for _ in range(20)
            )
        elif kind == "constant":
            data = bytes((0x36,)) * 300
        else:
            data = frozen + rng.randbytes(8)
        assert scanner.packet(packet(datagram(LRW, 0, data, 3)), cycle) == []
    assert scanner.connections() == []


@pytest.mark.parametrize("name", listed("pcap", "*.pcapng"))
def test_nothing_is_found_in_real_traffic_without_fsoe(name):
    path = need("pcap", name)
    scanner, packets = Scanner(), 0
    for time_ns, data in read_capture(path):
        packets += 1
        assert scanner.packet(data, time_ns) == []
    assert packets == scanner.counts().packets > 500
    assert scanner.counts().ethercat > 500
    assert scanner.connections() == []


# -- hostile packets ----------------------------------------------------------------------------

parts = st.one_of(
    st.binary(max_size=80),
    st.builds(
        datagram,
        st.integers(0, 15),
        st.integers(0, 0xFFFFFFFF),
        st.binary(max_size=60),
        st.integers(0, 0xFFFF),
        st.booleans(),
    ),
)


@given(st.lists(st.tuples(st.lists(parts, max_size=4), st.integers(0, 200)), max_size=30))
@settings(max_examples=examples(300))
@pytest.mark.uncounted
def test_any_packets_are_counted_without_a_connection(rows):
    scanner = Scanner()
    for number, (body, cut) in enumerate(rows):
        whole = packet(*body)
        scanner.packet(whole[: len(whole) - cut] if cut < len(whole) else whole, number)
    assert scanner.counts().packets == len(rows)
    assert scanner.connections() == []


@pytest.mark.parametrize("data", [b"", MAC, MAC + b"\x88", MAC + b"\x88\xa4", MAC + b"\x81\0" * 3])
def test_packets_cut_short(data):
    scanner = Scanner()
    assert scanner.packet(data, 0) == []


def test_tables_that_are_full_are_reported():
    scanner = Scanner()
    for address in range(2100):
        scanner.packet(packet(datagram(LRW, address << 12, bytes(20), 1)), address)
    assert scanner.counts().dropped == 52


# -- what captures of the field look like ---------------------------------------------------------


def test_same_connection_id_on_two_machines():
    """Resets are equal for all connections of a size, so they say nothing about copies."""
    buses = [Bus(2, 2, noise=False, seed=n) for n in (1, 2)]
    scanner = Scanner()
    for cycle in range(200):
        if cycle in (6, 12, 18, 24):  # a Session lies between, or it would be the same Reset
            for bus in buses:
                bus.main.request_reset()
        images = [bus.image() for bus in buses]
        one, other = (datagram(LRW, 0x1000 * n, data, 3, n == 0) for n, data in enumerate(images))
        scanner.packet(packet(one, other), cycle * 1_000_000)
    assert [c.connection_id for c in scanner.connections()] == [7, 7]
    assert all(c.state is ConnectionState.DATA_PROCESS for c in scanner.connections())


@pytest.mark.parametrize("by", ["source", "number"])
def test_two_buses_in_one_capture(by):
    """Two interfaces, or two MainDevices, use the same logical addresses."""
    scanner = Scanner()
    buses = [Bus(2, 2, connection_id=n + 1, seed=n) for n in (0, 1)]
    for cycle in range(100):
        for number, bus in enumerate(buses):
            data = bytearray(packet(datagram(LRW, 0, bus.image(), 3)))
            if by == "source":
                data[8] = number
            scanner.packet(bytes(data), cycle * 1_000_000, number if by == "number" else 0)
    assert sorted(c.connection_id for c in scanner.connections()) == [1, 2]


@pytest.mark.parametrize("at", range(1, 15))
def test_a_damaged_first_frame_does_not_hide_the_connection(at):
    """The length is taken from the blocks that fit each other; the next frames correct it."""
    bus, scanner = Bus(6, 6, noise=False), Scanner()
    bus.rng.randbytes = lambda size: bytes(range(1, size + 1))  # else new data correct it sooner
    for _ in range(61):
        bus.image()
    for cycle in range(120):
        image = bytearray(bus.image())
        if cycle == 2:
            image[bus.main_at + at] ^= 0x55
            image[bus.sub_at + at] ^= 0x55
        scanner.packet(packet(datagram(LRW, 0, bytes(image), 3)), cycle * 1_000_000)
    (found,) = [c for c in scanner.connections() if c.state is ConnectionState.DATA_PROCESS]
    assert {p.size_bytes for p in found.places} == {15}


def test_a_place_that_held_something_else_before():
    rng, bus, scanner = random.Random(1), Bus(2, 2), Scanner()
    for cycle in range(40):
        scanner.packet(packet(datagram(LRW, 0, rng.randbytes(200), 3)), cycle * 1_000_000)
    run(bus, 150, scanner, start=40, wrap=lambda data: packet(datagram(LRW, 0, data, 3)))
    assert len(scanner.connections()) == 1


def test_another_connection_at_the_same_place():
    """Two captures after each other, or a machine that was set up anew."""
    scanner = Scanner()
    first, second = Bus(2, 2, connection_id=7), Bus(2, 2, connection_id=8, seed=3)
    for bus in (first, second):
        for _ in range(61):
            bus.image()
    run(first, 100, scanner)
    before = scanner.connections()[0].to_sub.right
    run(second, 100, scanner, start=100)
    assert [c.connection_id for c in scanner.connections()] == [7, 8]
    seventh, eighth = scanner.connections()
    assert seventh.to_sub.right <= before + 1  # until it is clear that it is another one
    assert eighth.to_sub.right > 15


def test_a_copy_that_goes_its_own_way_is_not_a_copy():
    """The relay stops; later another connection with the same ConnID and length uses the place."""
    bus, other, scanner = Bus(2, 2, noise=False), Bus(2, 2, noise=False, seed=9), Scanner()
    for cycle in range(400):
        image = bytearray(bus.image())
        strange = other.image()
        if cycle >= 200:
            for at in (bus.main_copy_at, bus.sub_copy_at):
                image[at : at + 7] = strange[at : at + 7]
        scanner.packet(packet(datagram(LRW, 0, bytes(image), 3)), cycle * 1_000_000)
    assert len(scanner.connections()) == 2
    assert {c.to_sub.wrong + c.to_main.wrong for c in scanner.connections()} == {0}
