"""CRCs compared with known answers and long division; times compared with worked examples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from fsoe_net.self_test.model import TriedValue, reference

if TYPE_CHECKING:
    from fsoe_net.timing.formulas import PartTimes, SignalWay

_LENGTHS = range(1, 65)


def long_division(data: bytes, polynomial: int, bits: int) -> int:
    """Return the remainder of data times 2**bits, bit by bit, without tables or libraries.

    Args:
        data: Message, the most significant bit first.
        polynomial: Divisor with its leading bit.
        bits: Degree of the polynomial.
    """
    rest = 0
    for byte in data + bytes(bits // 8):
        for bit in range(7, -1, -1):
            rest = rest << 1 | byte >> bit & 1
            if rest >> bits:
                rest ^= polynomial
    return rest


def crcs_of_fsoe() -> Iterator[TriedValue]:
    """Compare the CRCs of FSoE with known frames and with long division."""
    from fsoe_net.fsoe.chain import reset_frame
    from fsoe_net.fsoe.crc import block_crc, frame_crcs, sra_crc

    known = reference()["crc"]
    for row in known["reset_frames"]:
        got = reset_frame(row["code"], row["safe_bytes"]).hex()
        yield TriedValue(f"Reset {row['code']} of {row['safe_bytes']} bytes", row["frame"], got)
    for row in known["sra"]:
        crc = f"{sra_crc(bytes.fromhex(row['data'])):08x}"
        yield TriedValue(f"SRA CRC of {row['data']}", row["crc"], crc)
    polynomials = known["polynomials"]
    for length in _LENGTHS:
        data = bytes(7 * n * n + length & 0xFF for n in range(length))
        divided = long_division(data, polynomials["sra"], 32)
        yield TriedValue(f"SRA CRC of {length} bytes, divided", divided, sra_crc(data))
    data = bytes(range(0x41, 0x41 + 8))
    for sequence in _LENGTHS:
        head = (0x1234).to_bytes(2, "little") + (0xABCD).to_bytes(2, "little")
        head += sequence.to_bytes(2, "little") + b"\x36"
        # The block number is part of the CRC, except in block 0; three zero bytes end the input.
        blocks = [
            (b"" if n == 0 else n.to_bytes(2, "little")) + data[2 * n : 2 * n + 2] + bytes(3)
            for n in range(4)
        ]
        crcs = [long_division(head + block, polynomials["block"], 16) for block in blocks]
        yield TriedValue(
            f"CRCs of frame {sequence}, divided",
            crcs,
            list(frame_crcs(0x1234, 0xABCD, sequence, 0x36, data)),
        )
        alone = block_crc(0x1234, 0xABCD, sequence, 0x36, 3, data[6:])
        yield TriedValue(f"CRC 3 of frame {sequence}, alone", crcs[3], alone)


def timing() -> Iterator[TriedValue]:
    """Compare watchdogs and response times with the worked tables."""
    known = reference()["timing"]
    yield from _printed(known)
    yield from _handshake(known)
    yield from _several_buses(known["several_buses"])


def _way(part: Mapping[str, Any], logic: float, copy_cycles: int = 2) -> SignalWay:
    from fsoe_net.timing.formulas import SignalWay
    from fsoe_net.timing.transit import transfer_time

    cycles = part["cycles"]
    return SignalWay(
        connection=part.get("name", "connection"),
        device=part["device"],
        logic=logic,
        to_logic=transfer_time(cycles, copy_cycles),
        from_logic=transfer_time(cycles[::-1], copy_cycles),
        cycle=max(cycles),
        watchdog=part.get("watchdog", 0.0),
    )


def _one_bus(parts: Mapping[str, float], cycle: float, k: int, watchdog: float = 0.0) -> PartTimes:
    from fsoe_net.timing.formulas import PartTimes

    there, back = (
        _way({"device": parts[name], "cycles": [cycle], "watchdog": watchdog}, parts["logic"], k)
        for name in ("input", "output")
    )
    return PartTimes(
        sensor=parts["sensor"], inputs=(there,), outputs=(back,), actuator=parts["actuator"]
    )


def _printed(known: Mapping[str, Any]) -> Iterator[TriedValue]:
    from fsoe_net.timing import formulas

    for row in known["rows"]:
        t = _one_bus(known["parts"], row["cycle"], row["k"])
        there, back = t.inputs[0], t.outputs[0]
        least_in, least_out = formulas.least_watchdog(there), formulas.least_watchdog(back)
        watchdog = max(least_in, least_out)
        trip = max(formulas.round_trip(there), formulas.round_trip(back))
        got = {
            "watchdog_input": least_in,
            "watchdog_output": least_out,
            "error_free": formulas.error_free(t),
            "worst_input": formulas.worst_case_input(t, least_in),
            "worst_output": formulas.worst_case_output(t, least_out),
            "beckhoff": formulas.beckhoff_worst_case(watchdog, watchdog, t.actuator),
            "margin_of_100_ms": 100 / watchdog,
            "lost_of_100_ms": formulas.lost_frames_survived(100, trip, row["cycle"]),
        }
        for name, expected in row["expected"].items():
            # Printed tables are rounded, so only their digits are compared.
            digits = len(str(expected).partition(".")[2])
            what = f"bus cycle {row['cycle']} ms, k {row['k']}: {name}"
            yield TriedValue(what, expected, round(got[name], digits))
    manual = known["beckhoff_typical"]
    typical = formulas.beckhoff_typical(_one_bus(manual["parts"], manual["cycle"], 2))
    yield TriedValue("typical, ms", manual["expected"], typical)


def _handshake(known: Mapping[str, Any]) -> Iterator[TriedValue]:
    from fsoe_net.timing import handshake

    counted = known["handshake"]
    t = _one_bus(known["parts"], counted["cycle"], 2, counted["watchdog"])
    there, back = t.inputs[0], t.outputs[0]
    got = {
        "polled_error_free": handshake.polled_error_free(t),
        "broken_input": handshake.broken_input(t, there),
        "broken_output": handshake.broken_output(t, back),
        "disturbed_input": handshake.disturbed_input(t, there),
        "disturbed_output": handshake.disturbed_output(t, back),
        "disturbed_shared": handshake.disturbed_shared(t, there, back),
        "disturbed_both": handshake.disturbed_both(t),
    }
    for name, expected in counted["expected"].items():
        yield TriedValue(f"{name}, ms", expected, got[name])


def _several_buses(known: Mapping[str, Any]) -> Iterator[TriedValue]:
    """Compare the figures of each connection of one safety function across two buses."""
    from fsoe_net.timing import formulas, handshake

    there, *back = (_way(part, known["logic"]) for part in known["ways"])
    t = formulas.PartTimes(
        sensor=known["sensor"], inputs=(there,), outputs=tuple(back), actuator=known["actuator"]
    )
    for part, way in zip(known["ways"], (there, *back), strict=True):
        is_in = way is there
        trip = formulas.round_trip(way)
        broken = handshake.broken_input if is_in else handshake.broken_output
        disturbed = handshake.disturbed_input if is_in else handshake.disturbed_output
        got = {
            "to_logic": way.to_logic,
            "from_logic": way.from_logic,
            "round_trip": trip,
            "least": formulas.least_watchdog(way),
            "lost": formulas.lost_frames_survived(way.watchdog, trip, way.cycle),
            "broken": broken(t, way),
            "disturbed": disturbed(t, way),
        }
        for name, expected in part["expected"].items():
            what = f"two buses, {part['name']}: {name}"
            yield TriedValue(what, expected, round(got[name], 6))
    got = {"error_free": formulas.error_free(t), "polled": handshake.polled_error_free(t)}
    for name, expected in known["expected"].items():
        yield TriedValue(f"two buses: {name}, ms", expected, got[name])
