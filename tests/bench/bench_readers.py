"""Measures the readers of other tools' files; prints limits too."""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from data_files import DATA
from described import bus
from formats.texts import PDOS

from fsoe_net.formats.eni.read import load_eni
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.shared.files import Collector


def best(reader, data: bytes, times: int = 5) -> float:
    """Return the processor seconds of the fastest of a few runs."""
    seconds = []
    for _ in range(times):
        start = time.process_time()
        assert reader(data, Collector()) is not None
        seconds.append(time.process_time() - start)
    return min(seconds)


def main() -> None:
    print(f"\n{'input':<44}{'kB':>8}{'s':>9}")
    real = DATA / "eni" / "kpierczy_test_eni.xml"
    rows = [(f"ENI, {n} SubDevices", load_eni, write_eni(bus(n - 1)).encode()) for n in (16, 160)]
    if real.is_file():
        data = real.read_bytes()
        rows.append(("ENI of another tool, 5 SubDevices", load_eni, data))
        # Eleven more SubDevices as long as its drives: what 16 of them would be.
        end = data.rindex(b"</Slave>") + len(b"</Slave>")
        one = data[data.rindex(b"<Slave>") : end]
        more = b"".join(
            one.replace(b"<AutoIncAddr>65532<", b"<AutoIncAddr>%d<" % (65532 - n))
            for n in range(1, 12)
        )
        rows.append(("the same with 16 SubDevices", load_eni, data[:end] + more + data[end:]))
    text = "".join(f"=== Master 0, Slave {n} ===\n{PDOS}" for n in range(1000)).encode()
    rows.append(("ethercat pdos, 1000 SubDevices", load_igh_text, text))
    for name, reader, data in rows:
        print(f"{name:<44}{len(data) / 1000:>8.0f}{best(reader, data):>9.3f}")
    print("limit: an ENI with 16 SubDevices below 0.5 s")


if __name__ == "__main__":
    main()
