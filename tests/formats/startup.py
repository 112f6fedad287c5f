"""A start-up as a capture shows it, made by hand: a logic, a terminal, and their MainDevice.

Every datagram is there twice, on its way out with working counter 0 and as it came back.
"""

from __future__ import annotations

import struct

from capture.traffic import Bus, datagram, packet
from formats.sii_image import category, image, strings

APRD, APWR, FPRD, FPWR, BRD, BWR, LRW = 1, 2, 4, 5, 7, 8, 12
LOGIC, TERMINAL = 0x1001, 0x1002
FRAMES = {  # station: (output PDO, input PDO), each (index, entries)
    LOGIC: (
        (0x1600, (0x70800108, 0x70810108, 0x70800310, 0x70800210)),
        (0x1A00, (0x60800108, 0x60810108, 0x60800310, 0x60800210)),
    ),
    TERMINAL: (
        (0x1600, (0x70000108, 0x00000008, 0x70000310, 0x70000210)),
        (0x1A00, (0x60000108, 0x60010101, 0x00000007, 0x60000310, 0x60000210)),
    ),
}
PRODUCTS = {LOGIC: 0x1AF63052, TERMINAL: 0x07703052}
OUT_START, IN_START = 0x1100, 0x1200


def sii(station):
    """Return an EEPROM with names and sync managers, and no PDOs."""
    rows = ((0x1000, 128, 0x26, 1), (0x1080, 128, 0x22, 2), (OUT_START, 6, 0x64, 3))
    managers = (*rows, (IN_START, 6, 0x20, 4))
    return image(
        strings(b"LOGIC" if station == LOGIC else b"TERMINAL"),
        category(30, bytes([0, 0, 1, 1, 0, 0x0F]) + bytes(26)),
        category(41, b"".join(struct.pack("<HHBBBB", s, n, c, 0, 1, u) for s, n, c, u in managers)),
        identity=(2, PRODUCTS[station], 0x120000, station),
    )


class Startup:
    """Packets one after the other; see the module."""

    def __init__(self, count=2, *, replies_only=False, vlan=False, alias=7):
        self.packets = []
        self.count = count
        self.replies_only = replies_only
        self.vlan = vlan
        self.alias = alias
        self.mailbox = 0

    def datagram(self, command, address, register, data, back=None, counter=1):
        """Send a datagram; ``back`` is what it comes back with."""
        number = struct.pack("<HH", address & 0xFFFF, register)
        if not self.replies_only:
            row = datagram(command, int.from_bytes(number, "little"), data, 0)
            self.packets.append(packet(row, vlan=self.vlan))
        if command in (APRD, APWR, BRD, BWR):
            address += self.count
        number = struct.pack("<HH", address & 0xFFFF, register)
        row = datagram(
            command, int.from_bytes(number, "little"), data if back is None else back, counter
        )
        self.packets.append(packet(row, vlan=self.vlan))

    def addresses(self):
        """Count the SubDevices, clear them and give them station addresses."""
        self.datagram(BRD, 0, 0, b"\0\0", b"\x11\0", self.count)
        self.datagram(BWR, 0, 0x0120, b"\x11\0", counter=self.count)
        self.datagram(BWR, 0, 0x0600, bytes(48), counter=self.count)
        self.datagram(BWR, 0, 0x0800, bytes(32), counter=self.count)
        for position, station in enumerate((LOGIC, TERMINAL)[: self.count]):
            self.datagram(APWR, -position, 0x0010, struct.pack("<H", station))
            self.datagram(APRD, -position, 0x0010, b"\0\0", struct.pack("<H", station))
            self.datagram(FPRD, station, 0x0012, b"\0\0", struct.pack("<H", position * self.alias))

    def eeprom(self, station, first=0, last=None, *, wide=False, busy=1):
        """Read words of an EEPROM."""
        data = sii(station)
        step = 4 if wide else 2
        for at in range(first, len(data) // 2 if last is None else last, step):
            self.datagram(FPWR, station, 0x0502, struct.pack("<HI", 0x0100, at))
            for _ in range(busy):
                self.datagram(FPRD, station, 0x0502, b"\0\0", struct.pack("<H", 0x8100))
            status = struct.pack("<H", 0x0040 if wide else 0)
            self.datagram(FPRD, station, 0x0502, b"\0\0", status)
            answer = data[2 * at : 2 * at + 2 * step].ljust(2 * step, b"\xff")
            self.datagram(FPRD, station, 0x0508, bytes(2 * step), answer)

    def managers(self, station):
        """Set up sync managers: two mailboxes, outputs, inputs."""
        for n, (start, size, control) in enumerate(
            ((0x1000, 128, 0x26), (0x1080, 128, 0x22), (OUT_START, 6, 0x64), (IN_START, 6, 0x20))
        ):
            row = struct.pack("<HHBBBB", start, size, control, 0, 1, 0)
            self.datagram(FPWR, station, 0x0800 + 8 * n, row)

    def fmmu(self, station, number, logical, start, *, is_input, size=6):
        row = struct.pack("<IHBBHBBB", logical, size, 0, 7, start, 0, 1 if is_input else 2, 1)
        self.datagram(FPWR, station, 0x0600 + 16 * number, row.ljust(16, b"\0"))

    # -- SDOs -------------------------------------------------------------------------------------

    def mail(self, station, service, body, *, answer):
        """Write a mailbox, or have one read."""
        self.mailbox = self.mailbox % 7 + 1
        body = struct.pack("<H", service << 12) + body
        data = struct.pack("<HHBB", len(body), 0, 0, 3 | self.mailbox << 4) + body
        data = data.ljust(128, b"\0")
        if answer:
            self.datagram(FPRD, station, 0x1080, bytes(128), data)
        else:
            self.datagram(FPWR, station, 0x1000, data)

    def ask(self, station, body):
        self.mail(station, 2, body, answer=False)

    def tell(self, station, body):
        self.mail(station, 3, body, answer=True)

    def upload(self, station, index, sub, data, *, complete=False, segments=0):
        """Read an object: expedited, normal, or in segments of some bytes."""
        flag = 0x10 if complete else 0
        self.ask(station, struct.pack("<BHBI", 0x40 | flag, index, sub, 0))
        if len(data) <= 4 and not segments:
            head = struct.pack("<BHB", 0x43 | flag | (4 - len(data)) << 2, index, sub)
            self.tell(station, head + data.ljust(4, b"\0"))
            return
        first = len(data) if not segments else 0
        self.tell(station, struct.pack("<BHBI", 0x41 | flag, index, sub, len(data)) + data[:first])
        toggle = 0
        for at in range(first, len(data), segments or 1):
            piece = data[at : at + segments]
            last = at + segments >= len(data)
            self.ask(station, struct.pack("<BHBI", 0x60 | toggle << 4, 0, 0, 0))
            unused = (7 - len(piece)) << 1 if len(piece) < 7 else 0
            self.tell(station, bytes([toggle << 4 | unused | last]) + piece.ljust(7, b"\0"))
            toggle ^= 1

    def download(self, station, index, sub, data, *, complete=False, segments=0, abort=0):
        """Write an object; ``abort`` is the code it is refused with."""
        flag = 0x10 if complete else 0
        if len(data) <= 4 and not segments:
            head = struct.pack("<BHB", 0x23 | flag | (4 - len(data)) << 2, index, sub)
            self.ask(station, head + data.ljust(4, b"\0"))
        else:
            first = len(data) if not segments else 0
            head = struct.pack("<BHBI", 0x21 | flag, index, sub, len(data))
            self.ask(station, head + data[:first])
        if abort:
            self.tell(station, struct.pack("<BHBI", 0x80, index, sub, abort))
            return
        self.tell(station, struct.pack("<BHBI", 0x60, index, sub, 0))
        if not segments:
            return
        toggle = 0
        for at in range(0, len(data), segments):
            piece = data[at : at + segments]
            last = at + segments >= len(data)
            unused = (7 - len(piece)) << 1 if len(piece) < 7 else 0
            self.ask(station, bytes([toggle << 4 | unused | last]) + piece.ljust(7, b"\0"))
            self.tell(station, bytes([0x20 | toggle << 4]) + bytes(7))
            toggle ^= 1

    def layout(self, station, *, how="upload"):
        """Let the PDOs be read or written: one by one, complete, in segments."""
        for manager, (index, entries) in zip((2, 3), FRAMES[station], strict=True):
            assign = 0x1C10 + manager
            if how == "upload":
                self.upload(station, assign, 0, b"\1")
                self.upload(station, assign, 1, struct.pack("<H", index))
                self.upload(station, index, 0, bytes([len(entries)]))
                for n, entry in enumerate(entries, 1):
                    self.upload(station, index, n, struct.pack("<I", entry))
                continue
            whole = struct.pack(f"<BB{len(entries)}I", len(entries), 0, *entries)
            segments = 7 if how == "segments" else 0
            self.download(station, index, 0, whole, complete=True, segments=segments)
            assigned = struct.pack("<BBH", 1, 0, index)
            self.download(station, assign, 0, assigned, complete=True)

    # -- whole runs -------------------------------------------------------------------------------

    def configure(self, *, how="upload", wide=False):
        """Do all of a start-up up to OP, for the places of `observe.traffic.Bus`."""
        self.addresses()
        for station, outputs, inputs in ((LOGIC, 150, 20), (TERMINAL, 100, 60))[: self.count]:
            self.eeprom(station, wide=wide)
            self.managers(station)
            self.layout(station, how=how)
            self.fmmu(station, 0, outputs, OUT_START, is_input=False)
            self.fmmu(station, 1, inputs, IN_START, is_input=True)
        self.datagram(BWR, 0, 0x0120, b"\x08\0", counter=self.count)

    def cycle(self, bus, count):
        """Let process data pass, with an FSoE connection relayed in them."""
        for _ in range(count):
            inputs = bus.image()
            out = bytearray(len(inputs))
            for at in (bus.main_copy_at, bus.sub_copy_at):
                out[at : at + 6] = inputs[at : at + 6]
            if not self.replies_only:
                self.packets.append(packet(datagram(LRW, 0, bytes(out), 0), vlan=self.vlan))
            self.packets.append(packet(datagram(LRW, 0, inputs, 6), vlan=self.vlan))

    def pcap(self, *, snap=None):
        """Return the packets as a file."""
        data = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
        for n, row in enumerate(self.packets):
            kept = row[:snap]
            data += struct.pack("<IIII", n // 1000, n % 1000 * 1000, len(kept), len(row)) + kept
        return data


def startup(*, how="upload", wide=False, cycles=0, **options):
    """Return a whole start-up as a file."""
    made = Startup(**options)
    made.configure(how=how, wide=wide)
    made.cycle(Bus(), cycles)
    return made.pcap()
