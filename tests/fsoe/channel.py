"""A black channel with held images, one bus cycle of delay each way, and faults to put into it."""

from __future__ import annotations

import random
from collections.abc import Callable

from fsoe.pair import counted, make_main, make_sub

from fsoe_net.fsoe import Command, State, frame_length

CYCLE_NS = 1_000_000
MAX_AGE_CYCLES = 20 + 6  # watchdog plus the way there and back plus the application's cycle
TO_SUB, TO_MAIN = "to_sub", "to_main"


class WrongData(AssertionError):
    """Valid safe data which the other end never sent, or sent too long ago."""


class Channel:
    """Runs a pair; its applications enable in Data and count bus cycles as safe data."""

    def __init__(self, out=2, inn=2, seed=0, **changes):
        self.main = make_main(out, inn, ids=counted(0x1122 + 77 * seed), **changes)
        self.sub = make_sub(out, inn, ids=counted(0x3344 + 99 * seed))
        self.cycle = 0
        self.images: dict[str, list[bytes | None]] = {TO_SUB: [None], TO_MAIN: [None]}
        self.valid_cycles = 0

    def end(self, direction: str):
        return self.sub if direction == TO_SUB else self.main

    def run(self, cycles: int, fault: Callable[[Channel, bytes | None], bytes | None], way: str):
        for _ in range(cycles):
            self.one(fault, way)

    def one(self, fault=None, way=TO_SUB):
        for direction, own in ((TO_SUB, TO_MAIN), (TO_MAIN, TO_SUB)):
            end = self.end(direction)
            end.enable = end.state is State.DATA
            end.set_safe_data(self._counted(end._sends))
            image = self.images[direction][self.cycle]
            if fault is not None and direction == way:
                image = fault(self, image)
            answer = end.step(self.cycle * CYCLE_NS, image)
            held = self.images[own]
            held.append(held[-1] if answer is None else answer)
            self._judge(end)
        self.cycle += 1

    def _counted(self, size: int) -> bytes:
        return (self.cycle + 1).to_bytes(2, "little") * (size // 2)

    def _judge(self, end):
        data = end.received_safe_data
        if not end.data_valid:
            if any(data) or (end.state is not State.DATA and end.enable):
                raise WrongData(f"cycle {self.cycle}: not valid, but {data.hex()}")
            return
        age = self.cycle + 1 - int.from_bytes(data[:2], "little")
        if not 0 <= age <= MAX_AGE_CYCLES:
            raise WrongData(f"cycle {self.cycle}: valid data {data.hex()} are {age} cycles old")
        if data != data[:2] * (len(data) // 2):
            raise WrongData(f"cycle {self.cycle}: torn data {data.hex()}")
        self.valid_cycles += 1

    def healthy(self) -> bool:
        return self.main.data_valid and self.sub.data_valid


def flip(byte: int, bit: int = 0):
    """Corruption of one bit."""

    def fault(_channel, image):
        if image is None:
            return None
        at = byte % len(image)
        return image[:at] + bytes((image[at] ^ 1 << bit,)) + image[at + 1 :]

    return fault


def lose(way: str):
    """The image stays as it was when the loss began."""
    frozen: list[bytes | None] = []

    def fault(channel, _image):
        if not frozen:
            frozen.append(channel.images[way][max(0, channel.cycle - 1)])
        return frozen[0]

    return fault


def delay(way: str, cycles: int):
    """Every image arrives this much later."""

    def fault(channel, _image):
        return channel.images[way][max(0, channel.cycle - cycles)]

    return fault


def repeat(way: str, nth: int, command: int | None = None):
    """An older frame again: the nth one before, or the first with this command."""

    def fault(channel, image):
        frames = list(dict.fromkeys(f for f in channel.images[way][: channel.cycle + 1] if f))
        if command is not None:
            frames = [frame for frame in frames if frame[0] == command][:1]
        return frames[-1 - nth] if len(frames) > nth else image

    return fault


def insert(way: str, connection_id: int, cycles: int):
    """A frame of another connection, in whatever state it is."""
    other = Channel(seed=5, connection_id=connection_id)
    other.run(cycles, None, way)

    def fault(_channel, image):
        frame = other.images[way][-1]
        return image if frame is None or image is None or len(frame) != len(image) else frame

    return fault


def masquerade(kind: str, way: str, seed: int):
    """Bytes that come from no FSoE end at all."""
    rng = random.Random(seed)

    def fault(channel, _image):
        size = frame_length(channel.end(way)._receives)
        if kind != "random":
            return bytes((0 if kind == "zeros" else 0xFF,)) * size
        return bytes((rng.choice(list(Command)),)) + rng.randbytes(size - 1)

    return fault


def reflect(way: str):
    """An end gets its own frame back."""
    own = TO_MAIN if way == TO_SUB else TO_SUB

    def fault(channel, image):
        frame = channel.images[own][channel.cycle]
        return image if frame is None or image is None or len(frame) != len(image) else frame

    return fault
