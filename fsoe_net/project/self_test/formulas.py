"""CRCs against known answers and against long division; times against worked examples."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.project.self_test.model import TriedValue, reference

__all__ = ["crcs_of_fsoe", "long_division", "timing"]

_LENGTHS = range(1, 65)


def long_division(data: bytes, polynomial: int, bits: int) -> int:
    """Return the remainder of data times 2**bits, bit by bit, without tables or libraries.

    Args:
        data: Message, the most significant bit first.
        polynomial: Divisor with its leading bit.
        bits: Its degree.
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
    from fsoe_net.timing import formulas, handshake
    from fsoe_net.timing.formulas import PartTimes

    known = reference()["timing"]
    for row in known["rows"]:
        k = row["k"]
        t = PartTimes(**known["parts"], cycle=row["cycle"], cycles_in=k, cycles_out=k)
        least_in, least_out = formulas.watchdog_input(t), formulas.watchdog_output(t)
        watchdog = max(least_in, least_out)
        trip = max(formulas.round_trip_input(t), formulas.round_trip_output(t))
        got = {
            "watchdog_input": least_in,
            "watchdog_output": least_out,
            "error_free": formulas.error_free(t),
            "worst_input": formulas.worst_case_input(t, least_in),
            "worst_output": formulas.worst_case_output(t, least_out),
            "beckhoff": formulas.beckhoff_worst_case(watchdog, watchdog, t.actuator),
            "margin_of_100_ms": 100 / watchdog,
            "lost_of_100_ms": formulas.lost_frames_survived(100, trip, t.cycle),
        }
        for name, expected in row["expected"].items():
            digits = len(str(expected).partition(".")[2])
            what = f"bus cycle {row['cycle']} ms, k {k}: {name}"
            yield TriedValue(what, expected, round(got[name], digits))
    manual = known["beckhoff_typical"]
    typical = formulas.beckhoff_typical(PartTimes(**manual["parts"]))
    yield TriedValue("typical, ms", manual["expected"], typical)
    counted = known["handshake"]
    t = PartTimes(**known["parts"], cycle=counted["cycle"])
    yield TriedValue("polled_error_free, ms", counted["error_free"], handshake.polled_error_free(t))
    for name, expected in counted["one_watchdog"].items():
        got_ms = getattr(handshake, name)(t, counted["watchdog"])
        yield TriedValue(f"{name}, ms", expected, got_ms)
    both = handshake.disturbed_both(t, counted["watchdog"], counted["watchdog"])
    yield TriedValue("disturbed_both, ms", counted["both"], both)
