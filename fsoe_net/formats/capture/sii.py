"""The EEPROM of a SubDevice, assembled from the reads of a MainDevice (registers 0x0502 …).

A read is a command with a word address, then 4 or 8 bytes of data once the SubDevice is no longer
busy. Data are used only if all of this was captured: a lost packet must not shift words.
"""

from __future__ import annotations

import struct

SII_REGISTERS = range(0x0502, 0x0510)
_CONTROL, _ADDRESS, _DATA = 0x0502, 0x0504, 0x0508
_BUSY, _REFUSED, _WIDE, _READ = 0x8000, 0x2000, 0x0040, 1
_STRINGS, _GENERAL = 10, 30
_GENERAL_WORDS = 3  # up to the mailbox protocols
_PROCESS_DATA = (41, 50, 51)  # categories: sync managers, TxPDO, RxPDO
_HEADER_WORDS, _END, _MOST_WORDS = 0x40, 0xFFFF, 0x10000


class SiiReads:
    """The known part of an EEPROM.

    Attributes:
        words: Words by address.
        conflicts: Words that were read with two values.
    """

    def __init__(self) -> None:
        self.words: dict[int, int] = {}
        self.conflicts: set[int] = set()
        self._address = bytearray(4)  # as the MainDevice wrote it
        self._at: int | None = None
        self._ready = self._wide = False

    def lost(self) -> None:
        """Note a command under way: until it returns, no data belong to an address."""
        self._at = None

    def written(self, register: int, data: bytes) -> None:
        """Process a write of the MainDevice that the SubDevice accepted."""
        end = register + len(data)
        for place in range(max(register, _ADDRESS), min(end, _DATA)):
            self._address[place - _ADDRESS] = data[place - register]
        if register <= _CONTROL + 1 < end:
            # Bits 8 … 10 of the control word: 1 reads, 2 writes, 4 reloads (ETG.1000.4).
            operation = data[_CONTROL + 1 - register] & 7
            if operation == _READ:
                self._at = int.from_bytes(self._address, "little")
            elif operation:
                self._at = None
            self._ready = False

    def status(self, control: int) -> None:
        """Process a control word read on the bus."""
        self._ready = not control & (_BUSY | _REFUSED)
        # The controller reads 8 bytes at once instead of 4.
        self._wide = bool(control & _WIDE)

    def read(self, register: int, data: bytes) -> None:
        """Process data read by the MainDevice from the SubDevice."""
        end = register + len(data)
        if register <= _CONTROL and end >= _CONTROL + 2:
            at = _CONTROL - register
            self.status(data[at] | data[at + 1] << 8)
        if register <= _ADDRESS and end >= _DATA and self._at is not None:
            at = _ADDRESS - register
            self._at = int.from_bytes(data[at : at + 4], "little")
        if register > _DATA or end < _DATA + 4 or not self._ready or self._at is None:
            return
        words = data[_DATA - register : _DATA - register + (8 if self._wide else 4)]
        for number, word in enumerate(
            struct.unpack(f"<{len(words) // 2}H", words[: len(words) & ~1])
        ):
            self._take(self._at + number, word)

    def _take(self, place: int, word: int) -> None:
        if place < _MOST_WORDS:
            if self.words.get(place, word) != word:
                self.conflicts.add(place)
            self.words[place] = word

    def _beginning(self, at: int, length: int) -> list[int]:
        """Return the words from an address on, up to the first one that was not read."""
        found = []
        for place in range(at, at + length):
            word = self.words.get(place)
            if word is None:
                break
            found.append(word)
        return found

    def number(self, place: int) -> int | None:
        """Return the 32 bits at a word address, or ``None`` if they were not read."""
        low, high = self.words.get(place), self.words.get(place + 1)
        return None if low is None or high is None else high << 16 | low

    def image(self) -> tuple[bytes, bool]:
        """Return an image of the categories that were read completely.

        Also return whether it includes all categories about process data. MainDevices skip
        categories that they do not need, such as most strings.
        """
        header = [self.words.get(place, 0) for place in range(_HEADER_WORDS)]
        found: list[int] = []
        at, whole = _HEADER_WORDS, True
        while True:
            kind, length = self.words.get(at), self.words.get(at + 1)
            if kind == _END:
                break
            if kind is None or length is None or at + 2 + length > _MOST_WORDS:
                whole = False
                break
            # Some images end with zeros instead of an end mark.
            if kind == 0 and length == 0:
                break
            known = self._beginning(at + 2, length)
            if len(known) < length:
                whole &= kind not in _PROCESS_DATA
                known = _usable(kind, known)
            if known:
                found += [kind, len(known), *known]
            at += 2 + length
        words = (*header, *found, _END)
        return struct.pack(f"<{len(words)}H", *words), whole


def _usable(kind: int, words: list[int]) -> list[int]:
    """Return complete content of a truncated category: the first strings, or the names."""
    if kind == _GENERAL:
        return words if len(words) >= _GENERAL_WORDS else []
    if kind != _STRINGS or not words:
        return []
    body = bytearray(struct.pack(f"<{len(words)}H", *words))
    at, count = 1, 0
    while count < body[0] and at < len(body) and at + 1 + body[at] <= len(body):
        at += 1 + body[at]
        count += 1
    body[0] = count
    return [word for (word,) in struct.iter_unpack("<H", body)] if count else []
