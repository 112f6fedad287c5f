"""Checks of one network interface: its type, and its other users."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from fsoe_net.host import ethtool
from fsoe_net.host.finding import Check, MachineFacts, MachineFix, MachineLevel
from fsoe_net.host.interrupts import interrupt_checks
from fsoe_net.host.permissions import PROGRAM
from fsoe_net.host.seam import Host, Unreadable

# ARPHRD_… in <linux/if_arp.h>.
_ETHERNET, _LOOPBACK = 1, 772
_IFF_UP = 1
_FRAME_BYTES = 1500


def interface_names(host: Host) -> list[str]:
    """Return the interfaces of this network namespace."""
    # /proc is read before sysfs, which may show another network namespace. Two lines are a heading.
    lines = (host.maybe("/proc/net/dev") or "").splitlines()[2:]
    found = [line.partition(":")[0].strip() for line in lines if ":" in line]
    return sorted(found) or host.names("/sys/class/net")


def _folder(host: Host, name: str) -> str:
    """Return the interface's folder in sysfs.

    Raises:
        Unreadable: sysfs is missing, or shows another network namespace.
    """
    folder = f"/sys/class/net/{name}"
    if not host.exists(folder):
        raise Unreadable(
            f"{folder} is not there: sysfs is missing or shows another network namespace"
        )
    return folder


def _exists(host: Host, name: str) -> Iterator[MachineFacts]:
    names = interface_names(host)
    if name not in names:
        others = ", ".join(n for n in names if n != "lo") or "none"
        yield MachineFacts(
            level=MachineLevel.BAD,
            text=f"unknown interface {name}; there are: {others}",
            now=("ip -br link shows their names and MAC addresses",),
        )
        return
    folder = _folder(host, name)
    kind = host.number(f"{folder}/type")
    # Only real hardware has a device in sysfs.
    virtual = not host.exists(f"{folder}/device")
    # From the most obvious reason to the most specific one: the first answer must help.
    if host.exists(f"{folder}/wireless") or host.exists(f"{folder}/phy80211"):
        yield MachineFacts(
            level=MachineLevel.BAD, text="a wireless interface: EtherCAT needs a cable"
        )
    elif kind == _LOOPBACK:
        yield MachineFacts(level=MachineLevel.BAD, text="the loopback interface")
    elif kind != _ETHERNET:
        yield MachineFacts(
            level=MachineLevel.BAD, text=f"no Ethernet interface (hardware type {kind})"
        )
    # Frames through a bridge are delayed and mixed with those of others.
    elif host.exists(f"{folder}/bridge") or host.exists(f"{folder}/bonding"):
        yield MachineFacts(
            level=MachineLevel.BAD,
            text="a bridge or bond: name the Ethernet interface below it",
            now=(f"ip -br link show master {name}",),
        )
    else:
        yield MachineFacts(
            level=MachineLevel.NOTE if virtual else MachineLevel.GOOD,
            text=_driver_text(host, name, virtual=virtual),
        )


def _driver_text(host: Host, name: str, *, virtual: bool) -> str:
    driver = host.target(f"/sys/class/net/{name}/device/driver")
    if driver is None:
        try:
            driver = ethtool.driver(host, name)
        except OSError:
            driver = "unknown"
    text = f"driver {driver}"
    return f"{text}: no card, frames stay in this machine" if virtual else text


def _state(host: Host, name: str) -> Iterator[MachineFacts]:
    folder = _folder(host, name)
    up = host.number(f"{folder}/flags") & _IFF_UP
    if not up:
        yield MachineFacts(
            level=MachineLevel.BAD,
            text="it is down",
            now=(f"ip link set {name} up",),
            keep=(
                f"printf '[Match]\\nName={name}\\n[Network]\\nLinkLocalAddressing=no\\n"
                f"IPv6AcceptRA=no\\n' > /etc/systemd/network/10-{name}.network; "
                "systemctl restart systemd-networkd",
            ),
        )
    elif host.maybe(f"{folder}/carrier") != "1":
        yield MachineFacts(
            level=MachineLevel.BAD,
            text="it is up and has no link",
            now=("cable, power of the first SubDevice, its IN port",),
        )
    else:
        yield MachineFacts(level=MachineLevel.GOOD, text="up, link")


def _speed(host: Host, name: str) -> Iterator[MachineFacts]:
    folder = _folder(host, name)
    duplex, text = host.maybe(f"{folder}/duplex"), host.maybe(f"{folder}/speed")
    if duplex is None or text is None or not text.isdecimal():
        raise Unreadable("speed and duplex are not reported; an interface without link has none")
    speed = int(text)
    # EtherCAT has no half duplex and no 10 Mbit/s.
    if duplex == "half" or speed < 100:
        yield MachineFacts(
            level=MachineLevel.BAD,
            text=f"{speed} Mbit/s, {duplex} duplex; EtherCAT is 100 Mbit/s full duplex",
            now=(f"ethtool -s {name} autoneg on", "another cable"),
        )
    elif duplex != "full":
        raise Unreadable(f"{speed} Mbit/s, duplex {duplex}")
    else:
        yield MachineFacts(level=MachineLevel.GOOD, text=f"{speed} Mbit/s, full duplex")


def _mtu(host: Host, name: str) -> Iterator[MachineFacts]:
    mtu = host.number(f"{_folder(host, name)}/mtu")
    if mtu >= _FRAME_BYTES:
        yield MachineFacts(level=MachineLevel.GOOD, text=f"{mtu} bytes")
    else:
        yield MachineFacts(
            level=MachineLevel.BAD,
            text=f"{mtu} bytes: frames of more are refused",
            now=(f"ip link set {name} mtu {_FRAME_BYTES}",),
            keep=(f"MTUBytes={_FRAME_BYTES} in the [Link] section of a .link file for {name}",),
        )


def _member(host: Host, name: str) -> Iterator[MachineFacts]:
    master = host.target(f"{_folder(host, name)}/master")
    if master is None:
        yield MachineFacts(level=MachineLevel.GOOD, text="in no bridge, bond or team")
    else:
        yield MachineFacts(
            level=MachineLevel.BAD,
            text=f"part of {master}: it takes the frames that come back",
            now=(f"ip link set {name} nomaster",),
            keep=(f"take {name} out of {master} where that is configured",),
        )


def _addresses(host: Host, name: str) -> Iterator[MachineFacts]:
    output = host.seam.command("ip", "-j", "address", "show", "dev", name)
    if output is None:
        raise Unreadable("`ip -j address` is not there or failed")
    try:
        rows = [a for link in json.loads(output or "[]") for a in link.get("addr_info", [])]
        found = [f"{a['local']}/{a['prefixlen']}" for a in rows]
        local = all(a.get("scope") == "link" for a in rows)
    except (ValueError, KeyError, TypeError, AttributeError) as exc:
        raise Unreadable("`ip -j address` answers in another form") from exc
    if not found:
        yield MachineFacts(level=MachineLevel.GOOD, text="none")
        return
    yield MachineFacts(
        # A link-local address sends only a few frames; a real one means that a network is
        # connected.
        level=MachineLevel.NOTE if local else MachineLevel.WARNING,
        text=", ".join(found),
        now=(f"ip address flush dev {name}", f"sysctl -w net.ipv6.conf.{name}.disable_ipv6=1"),
        keep=(
            f"echo net.ipv6.conf.{name}.disable_ipv6=1 >> /etc/sysctl.d/90-fsoe-net.conf; "
            "no address for it in the network configuration",
        ),
    )


def _managers(host: Host, name: str) -> Iterator[MachineFacts]:
    if not host.pids():
        raise Unreadable("/proc shows no processes")
    seen = False
    if host.processes("NetworkManager"):
        output = host.seam.command("nmcli", "-t", "-f", "DEVICE,STATE", "device")
        if output is None:
            raise Unreadable("NetworkManager runs, but `nmcli` does not answer")
        state = dict(line.rsplit(":", 1) for line in output.splitlines() if ":" in line).get(name)
        # NetworkManager sends DHCP on interfaces that it manages, between the frames.
        if state not in (None, "unmanaged"):
            seen = True
            yield MachineFacts(
                level=MachineLevel.WARNING,
                text=f"NetworkManager manages it ({state}): it may send DHCP or take it down",
                now=(f"nmcli device set {name} managed no",),
                keep=(
                    f"printf '[keyfile]\\nunmanaged-devices=interface-name:{name}\\n' > "
                    "/etc/NetworkManager/conf.d/90-fsoe-net.conf; systemctl reload NetworkManager",
                ),
            )
    index = host.maybe(f"/sys/class/net/{name}/ifindex")
    link = host.maybe(f"/run/systemd/netif/links/{index}") or ""
    state = next((row[12:] for row in link.splitlines() if row.startswith("ADMIN_STATE=")), None)
    if state not in (None, "unmanaged") and "NETWORK_FILE=" in link:
        seen = True
        yield MachineFacts(
            level=MachineLevel.NOTE,
            text=f"systemd-networkd configures it ({state})",
            now=(f"networkctl status {name} names the file",),
            keep=(
                f"[Match] Name={name} with [Link] Unmanaged=yes in a .network file that is first",
            ),
        )
    if not seen:
        yield MachineFacts(level=MachineLevel.GOOD, text="no network manager has it")


def _sockets(host: Host, name: str) -> Iterator[MachineFacts]:
    index = host.number(f"{_folder(host, name)}/ifindex")
    rows = [line.split() for line in host.read("/proc/net/packet").splitlines()[1:]]
    # A socket of interface 0 listens on all interfaces.
    inodes = {r[8]: r[3] for r in rows if len(r) > 8 and r[4] in (str(index), "0")}
    if not inodes:
        yield MachineFacts(level=MachineLevel.GOOD, text="no packet socket is open on it")
        return
    owners = _owners(host, set(inodes))
    hidden = len(set(inodes) - {inode for found in owners.values() for inode in found})
    for (pid, command), found in sorted(owners.items()):
        # Our own process is expected there.
        if command == PROGRAM:
            yield MachineFacts(level=MachineLevel.GOOD, text=f"{PROGRAM} (process {pid}) drives it")
            continue
        # 0x88a4 is EtherCAT: two MainDevices on one bus disturb each other.
        sends = any(inodes[inode].lower() == "88a4" for inode in found)
        yield MachineFacts(
            level=MachineLevel.BAD if sends else MachineLevel.WARNING,
            text=f"{command} (process {pid}) has a packet socket on it"
            + (" for EtherCAT: two MainDevices?" if sends else ""),
            now=(f"kill {pid}",),
        )
    # The table lists sockets of all processes; their owners are hidden from users.
    if hidden:
        yield MachineFacts(
            level=MachineLevel.NOTE,
            text=f"{hidden} packet sockets of processes not seen from here; root sees them",
        )


def _owners(host: Host, inodes: set[str]) -> dict[tuple[int, str], list[str]]:
    owners: dict[tuple[int, str], list[str]] = {}
    for pid in host.pids():
        # Without root the descriptors of other users cannot be read, so their owners are missing.
        for number in host.names(f"/proc/{pid}/fd"):
            link = host.link(f"/proc/{pid}/fd/{number}") or ""
            inode = link.removeprefix("socket:[").removesuffix("]")
            if link.startswith("socket:[") and inode in inodes:
                command = host.maybe(f"/proc/{pid}/comm") or "?"
                owners.setdefault((pid, command), []).append(inode)
    return owners


def _asked(ask: Callable[[], Iterator[MachineFacts]]) -> Iterator[MachineFacts]:
    """Convert an error of a driver to a reason."""
    try:
        yield from list(ask())
    except OSError as exc:
        raise Unreadable(f"the driver does not say ({exc.strerror})") from exc


def _parameters(words: Mapping[str, str]) -> str:
    return " ".join(f"{key} {value}" for key, value in words.items())


def _coalescing_fix(name: str, found: ethtool.Coalescing) -> MachineFix:
    """Return a fix of what differs only: a driver rejects parameters that it does not have."""
    wanted = ethtool.AT_ONCE.words()
    before = {key: value for key, value in found.words().items() if value != wanted[key]}
    after = {key: wanted[key] for key in before}
    command = f"ethtool -C {shlex.quote(name)}"
    return MachineFix(
        do=(f"{command} {_parameters(after)}",),
        undo=(f"{command} {_parameters(before)}",),
    )


def _coalescing(host: Host, name: str) -> Iterator[MachineFacts]:
    def ask() -> Iterator[MachineFacts]:
        found = ethtool.coalescing(host, name)
        # One frame per interrupt means no delay, whatever the time setting is.
        late = found.rx_us if found.rx_frames != 1 else 0
        adaptive = found.adaptive_rx or found.adaptive_tx
        if not late and not adaptive:
            yield MachineFacts(level=MachineLevel.GOOD, text="each frame is seen at once")
            return
        yield MachineFacts(
            level=MachineLevel.WARNING if late > 10 or adaptive else MachineLevel.NOTE,
            text=f"a frame is seen up to {late} us late"
            + (", and the card chooses by itself (adaptive)" if adaptive else ""),
            now=(f"ethtool -C {name} {_parameters(ethtool.AT_ONCE.words())}",),
            fix=_coalescing_fix(name, found),
            keep=(
                f"printf '[Match]\\nOriginalName={name}\\n[Link]\\nRxCoalesceSec=0\\n"
                f"TxCoalesceSec=0\\n' > /etc/systemd/network/10-{name}.link; reboot",
            ),
        )

    return _asked(ask)


def _offloads(host: Host, name: str) -> Iterator[MachineFacts]:
    def ask() -> Iterator[MachineFacts]:
        gro, lro = ethtool.generic_receive(host, name), ethtool.large_receive(host, name)
        if not gro and not lro:
            yield MachineFacts(level=MachineLevel.GOOD, text="frames are not merged")
            return
        yield MachineFacts(
            level=MachineLevel.WARNING if lro else MachineLevel.NOTE,
            text=" and ".join(w for w, on in (("GRO", gro), ("LRO", lro)) if on)
            + " on: meant for TCP; of EtherCAT they gather nothing, but each frame passes there",
            now=(f"ethtool -K {name} gro off lro off",),
            keep=(f"GenericReceiveOffload=no, LargeReceiveOffload=no in the .link file of {name}",),
        )

    return _asked(ask)


def _energy(host: Host, name: str) -> Iterator[MachineFacts]:
    def ask() -> Iterator[MachineFacts]:
        found = ethtool.eee(host, name)
        if not found.enabled:
            yield MachineFacts(level=MachineLevel.GOOD, text="off")
            return
        yield MachineFacts(
            level=MachineLevel.WARNING if found.active else MachineLevel.NOTE,
            text="in use: the link sleeps between frames" if found.active else "on, not in use",
            now=(f"ethtool --set-eee {name} eee off",),
            keep=(f"a udev rule or unit that runs that when {name} appears",),
        )

    return _asked(ask)


def _errors(host: Host, name: str) -> Iterator[MachineFacts]:
    folder = f"{_folder(host, name)}/statistics"
    kinds = ("rx_errors", "rx_crc_errors", "rx_dropped", "tx_errors", "tx_dropped", "collisions")
    output = {kind: host.maybe(f"{folder}/{kind}") or "" for kind in kinds}
    counts = {kind: int(text) for kind, text in output.items() if text.isdecimal()}
    if not counts:
        raise Unreadable(f"{folder}: no counters")
    found = {kind: n for kind, n in counts.items() if n}
    if not found:
        yield MachineFacts(level=MachineLevel.GOOD, text="none since it came up")
        return
    # Physical errors are caused by cable and connector; dropped frames by the machine.
    physical = any(found.get(k) for k in ("rx_errors", "rx_crc_errors", "collisions"))
    yield MachineFacts(
        level=MachineLevel.WARNING if physical else MachineLevel.NOTE,
        text=", ".join(f"{kind} {n}" for kind, n in found.items()),
        now=(f"ip -s link show {name}, twice: do they grow? then cable, plug, grounding",),
    )


_CHECKS = (
    ("exists", "Only an Ethernet interface of its own carries EtherCAT.", _exists),
    (
        "state",
        "Without a link no frame goes out, and every FSoE connection on it is in Reset.",
        _state,
    ),
    (
        "speed",
        "Half duplex means collisions; each lost frame is a cycle in which no FSoE frame moves.",
        _speed,
    ),
    ("mtu", "A plan with much process data fills frames of up to 1514 bytes.", _mtu),
    (
        "member",
        "A bridge or bond takes frames before EtherCAT sees them and floods the segment with its "
        "own.",
        _member,
    ),
    (
        "address",
        "With an IP address the kernel itself sends ARP, DHCP and neighbour discovery into the "
        "segment, between two cycles or in the middle of one.",
        _addresses,
    ),
    (
        "manager",
        "A network manager that finds no DHCP server takes the interface down and up again: the "
        "bus is gone for seconds, every FSoE watchdog expires.",
        _managers,
    ),
    (
        "sockets",
        "A second MainDevice overwrites outputs, FSoE frames among them: connections reset by "
        "chance. A recorder costs a copy of each frame.",
        _sockets,
    ),
    (
        "coalescing",
        "The card keeps a frame that is back until its time is over; each cycle and each FSoE "
        "round trip gets longer by that.",
        _coalescing,
    ),
    ("offloads", "What gathers frames delays single ones.", _offloads),
    (
        "eee",
        "A link that sleeps between frames needs tens of microseconds to wake up, each cycle.",
        _energy,
    ),
    (
        "errors",
        "A frame that arrives broken is a lost cycle; some in a row are longer than a watchdog.",
        _errors,
    ),
)


def interface_checks(name: str) -> tuple[Check, ...]:
    """Return the checks of the interface with this name."""
    mine = tuple(
        Check(name=f"interface.{what}", why=why, look=partial(look, name=name))
        for what, why, look in _CHECKS
    )
    return mine + interrupt_checks(name)
