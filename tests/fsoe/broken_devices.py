"""Ends of a stranger that break in every way; found by name like those in `devices`."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys

from fsoe.devices import strange_sub

_LIBC = ctypes.CDLL(None)


def _stepping(name, answer, after=0):
    class Sub(strange_sub):
        calls = 0

        def step(self, now_ns, received):
            self.calls += 1
            frame = super().step(now_ns, received)
            return frame if self.calls <= after else answer(frame)

    Sub.__name__ = name
    return Sub


def _exit(_frame):
    sys.exit()


class _Odd:
    def __repr__(self):
        raise ValueError("no repr either")


def _die(_frame):
    os._exit(0)


dies = _stepping("dies", _die)
exits = _stepping("exits", _exit)
exits_later = _stepping("exits_later", _exit, after=40)
returns_text = _stepping("returns_text", lambda _: "hallo")
returns_number = _stepping("returns_number", lambda _: 42)
returns_nothing = _stepping("returns_nothing", lambda _: b"")
returns_long = _stepping("returns_long", lambda _: bytes(5000))
returns_short = _stepping("returns_short", lambda frame: frame and frame[:-1])
returns_odd = _stepping("returns_odd", lambda _: _Odd())


class deaf(strange_sub):  # noqa: N801 - named like a factory
    """A device that takes SIGTERM for itself, in the processes of a campaign alone."""

    def __init__(self, config):
        super().__init__(config)
        if multiprocessing.parent_process() is not None:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)


class takes_nothing(strange_sub):  # noqa: N801 - named like a factory
    def step(self):
        return None


def _data(name, value):
    return type(name, (strange_sub,), {"received_safe_data": property(lambda _: value)})


def _valid(name, value):
    return type(name, (strange_sub,), {"data_valid": property(lambda _: value)})


data_none = _data("data_none", None)
data_text = _data("data_text", "00")
data_long = _data("data_long", bytes(100))
valid_text = _valid("valid_text", "yes")
valid_two = _valid("valid_two", 2)


class valid_raises(strange_sub):  # noqa: N801 - named like a factory
    @property
    def data_valid(self):
        return self.no_such_thing


class cycle_raises(strange_sub):  # noqa: N801 - named like a factory
    def power_cycle(self):
        raise RuntimeError("no\npower")


class watchdog_text(strange_sub):  # noqa: N801 - named like a factory
    def watchdog_remaining_ns(self, now_ns):
        return "soon"


class watchdog_raises(strange_sub):  # noqa: N801 - named like a factory
    def watchdog_remaining_ns(self, now_ns):
        raise KeyError("dog")


class refuses_data(strange_sub):  # noqa: N801 - named like a factory
    def set_safe_data(self, data):
        raise ValueError("x" * 5000)


class refuses_enable(strange_sub):  # noqa: N801 - named like a factory
    enable = property(lambda _: False)

    def set_safe_data(self, data):
        pass


class refuses_snapshot(strange_sub):  # noqa: N801 - named like a factory
    def snapshot(self):
        raise TypeError("cannot pickle")

    def restore(self, state):
        pass


def exiting_factory(_config):
    sys.exit("bye")


def no_argument():
    return None


class talks(strange_sub):  # noqa: N801 - named like a factory
    """Prints, from Python and from C, and returns what is right."""

    def step(self, now_ns, received):
        print("NOISE of python")  # noqa: T201 - the point
        _LIBC.printf(b"NOISE of C\n")
        return super().step(now_ns, received)


class right_in_other_types(strange_sub):  # noqa: N801 - named like a factory
    """Returns what fits though it is of another type, and no data while there are none."""

    def step(self, now_ns, received):
        frame = super().step(now_ns, received)
        return frame and bytearray(frame)

    @property
    def data_valid(self):
        return int(super().data_valid)

    @property
    def received_safe_data(self):
        return bytearray(super().received_safe_data) if super().data_valid else None
