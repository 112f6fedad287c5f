"""Structs for SIOCETHTOOL requests to a network driver. Numbers in host order."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from fsoe_net.host.seam import Host

# ETHTOOL_… in <linux/ethtool.h>.
_GDRVINFO, _GCOALESCE, _GGRO, _GFLAGS, _GEEE = 0x03, 0x0E, 0x2B, 0x25, 0x44
_FLAG_LRO = 1 << 15
_WORD = struct.Struct("=II")
_COALESCE = struct.Struct("=23I")
_EEE = struct.Struct("=10I")
_DRVINFO = struct.Struct("=I32s32s32s32s32s12s5I")


@dataclass(frozen=True, slots=True, kw_only=True)
class Coalescing:
    """How long a driver collects frames before it interrupts; times in microseconds."""

    rx_us: int
    rx_frames: int
    tx_us: int
    adaptive_rx: bool
    adaptive_tx: bool

    def words(self) -> dict[str, str]:
        """Return its parameters for `ethtool -C`."""
        switch = ("off", "on")
        return {
            "adaptive-rx": switch[self.adaptive_rx],
            "adaptive-tx": switch[self.adaptive_tx],
            "rx-usecs": str(self.rx_us),
            "tx-usecs": str(self.tx_us),
        }


AT_ONCE = Coalescing(rx_us=0, rx_frames=0, tx_us=0, adaptive_rx=False, adaptive_tx=False)
"""No frame waits for another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Eee:
    """Energy Efficient Ethernet: whether it is permitted, and active with this link partner."""

    enabled: bool
    active: bool


def _ask(host: Host, interface: str, code: int, form: struct.Struct) -> tuple[int, ...]:
    request = struct.pack("=I", code).ljust(form.size, b"\0")
    answer: tuple[int, ...] = form.unpack(host.seam.ethtool(interface, request))
    return answer


def coalescing(host: Host, interface: str) -> Coalescing:
    """Return how frames are collected; raises `OSError` if the driver does not report it."""
    row = _ask(host, interface, _GCOALESCE, _COALESCE)
    # struct ethtool_coalesce: words 10 and 11 switch the adaptive modes on.
    return Coalescing(
        rx_us=row[1],
        rx_frames=row[2],
        tx_us=row[5],
        adaptive_rx=bool(row[10]),
        adaptive_tx=bool(row[11]),
    )


def eee(host: Host, interface: str) -> Eee:
    """Return the state of EEE; raises `OSError` if the driver does not report it."""
    row = _ask(host, interface, _GEEE, _EEE)
    # struct ethtool_eee: words 1 … 3 are speeds.
    return Eee(active=bool(row[4]), enabled=bool(row[5]))


def generic_receive(host: Host, interface: str) -> bool:
    """Return whether the kernel merges frames (GRO); raises `OSError`."""
    return bool(_ask(host, interface, _GGRO, _WORD)[1])


def large_receive(host: Host, interface: str) -> bool:
    """Return whether the network card merges frames (LRO); raises `OSError`."""
    return bool(_ask(host, interface, _GFLAGS, _WORD)[1] & _FLAG_LRO)


def driver(host: Host, interface: str) -> str:
    """Return the name of the driver; raises `OSError`."""
    request = struct.pack("=I", _GDRVINFO).ljust(_DRVINFO.size, b"\0")
    row = _DRVINFO.unpack(host.seam.ethtool(interface, request))
    name: bytes = row[1]
    return name.partition(b"\0")[0].decode("utf-8", "replace")
