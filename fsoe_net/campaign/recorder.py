"""Records a run of a channel in the format that `fsoe_net.campaign.recording` reads (§13)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from fsoe_net.campaign.channel import Channel, Peer, SessionIds, Way
from fsoe_net.campaign.clean_run import TrialConnection
from fsoe_net.fsoe.chain import fits_start
from fsoe_net.fsoe.event import EventKind
from fsoe_net.fsoe.instance import Instance
from fsoe_net.fsoe.pdu import Command, decode_pdu, is_frame_length

_Call = dict[str, Any]


class _Tap:
    """Wraps an end and records every call; other attributes are passed through."""

    def __init__(self, end: Peer, key: str, size: int, ids: SessionIds | None) -> None:
        self._end, self._key, self._ids = end, key, ids
        self._app, self._commands = bytes(size), list[str]()
        self.calls: dict[int, _Call] = {}
        if hasattr(end, "set_safe_data"):
            self.set_safe_data = self._set_safe_data

    def __getattr__(self, name: str) -> Any:
        if name in ("snapshot", "restore"):  # a recording cannot return to an earlier point
            raise AttributeError(name)
        return getattr(self._end, name)

    @property
    def enable(self) -> bool:
        return bool(getattr(self._end, "enable", False))

    @enable.setter
    def enable(self, value: bool) -> None:
        self._end.enable = value  # type: ignore[attr-defined]  # optional part of a Peer
        self._commands.append(f"{self._key}.{'enable' if value else 'disable'}")

    def _set_safe_data(self, data: bytes) -> None:
        self._end.set_safe_data(data)  # type: ignore[attr-defined]  # optional part of a Peer
        self._app = data

    def step(self, now_ns: int, received: bytes | None) -> bytes | None:
        # The id of this call only: an end draws one when it opens a session.
        if self._ids is not None:
            self._ids.drawn = None
        answer = self._end.step(now_ns, received)
        key = self._key
        out = "master_app_out" if key == "master" else "slave_app_in"
        seen = "safe_inputs" if key == "master" else "safe_outputs"
        self.calls[now_ns] = {
            "commands": self._commands,
            out: self._app.hex(),
            f"{key}_rx": None if received is None else received.hex(),
            f"{key}_tx": None if answer is None else answer.hex(),
            f"{key}_pd_valid": self._end.data_valid,
            seen: self._end.received_safe_data.hex(),
            f"{key}_session_id": self._ids.drawn if self._ids is not None else None,
            **self._inner(),
        }
        self._commands = []
        return answer

    def _inner(self) -> _Call:
        """Return data that only our own ends report: the state, and which end caused a Reset."""
        key, end = self._key, self._end
        # A foreign end provides frames only; its state is unknown.
        if not isinstance(end, Instance) or self._ids is None:
            return {f"{key}_state": None, f"{key}_event": "none", f"{key}_reason": None}
        events = end.take_events()
        event = events[-1] if events and events[-1].kind is not EventKind.STATE else None
        by = "none"
        if event is not None:
            local = event.kind is EventKind.RESET_LOCAL
            by = "by_master" if local == (key == "master") else "by_slave"
        return {
            f"{key}_state": end.state.value,
            f"{key}_event": by,
            f"{key}_reason": None if event is None else event.code,
        }


class Recorder:
    """A new channel of a connection whose calls are recorded.

    Args:
        link: The connection; foreign ends are recorded by their frames and data only.
        seed: Seed of the session ids and data of our ends.

    Attributes:
        channel: The channel to run.
    """

    def __init__(self, link: TrialConnection, seed: int) -> None:
        self._link = link
        channel = link.channel(seed)
        foreign = (link.sub_factory is not None, link.main_factory is not None)
        ids = (channel.session_ids[1], channel.session_ids[0])
        self._taps = tuple(
            _Tap(
                channel.ends[way],
                "master" if way is Way.TO_MAIN else "slave",
                link.sizes[1 - way],
                None if foreign[way] else ids[way],
            )
            for way in Way
        )
        self._foreign = foreign
        self.channel = Channel(
            self._taps[Way.TO_MAIN],
            self._taps[Way.TO_SUB],
            sizes=channel.sizes,
            cycle_ns=channel.cycle_ns,
            delay_cycles=channel.delay_cycles,
            application=channel.application,
            session_ids=channel.session_ids,
            tables=channel.tables,
        )

    def lines(self, note: str = "") -> Iterator[str]:
        """Return the recording so far, line by line; an incomplete cycle is completed first.

        Args:
            note: Description for people.
        """
        # Both ends of a cycle belong to one line.
        while self.channel.way is not Way.TO_MAIN:
            self.channel.turn()
        yield json.dumps(self._config(note))
        calls = [dict(tap.calls) for tap in self._taps]
        for way in Way:
            if self._foreign[way]:
                self._find_ids(way, calls[way])
        for n, now_ns in enumerate(sorted(calls[Way.TO_MAIN])):
            main, sub = calls[Way.TO_MAIN][now_ns], calls[Way.TO_SUB][now_ns]
            row = {"type": "step", "n": n, "time_us": _us(now_ns), **main, **sub}
            row["commands"] = main["commands"] + sub["commands"]
            yield json.dumps(row)

    def _config(self, note: str) -> dict[str, Any]:
        main, sub = self._link.main, self._link.sub
        return {
            "type": "config",
            "title": note,
            "slave_address": main.address,
            "slave_own_address": sub.address,
            "slave_app_param_size": sub.app_parameter_bytes,
            "connection_id": main.connection_id,
            "master_session_id": 0,
            "slave_session_id": 0,
            "watchdog_ms": main.watchdog_ms,
            "app_params": main.app_parameters.hex(),
            "out_size": main.safe_out_bytes,
            "in_size": main.safe_in_bytes,
            "bus_cycle_us": _us(self._link.cycle_ns),
            "master_impl": "foreign" if self._foreign[Way.TO_MAIN] else "fsoe-net",
            "slave_impl": "foreign" if self._foreign[Way.TO_SUB] else "fsoe-net",
        }

    def _find_ids(self, way: Way, calls: dict[int, _Call]) -> None:
        """Read the session ids of a foreign end from its Session frames."""
        key = "master" if way is Way.TO_MAIN else "slave"
        first: _Call | None = None
        for now_ns in sorted(calls):
            call = calls[now_ns]
            sent = _session(call[f"{key}_tx"])
            if sent is None:
                continue
            opener = call[f"{key}_tx"] if way is Way.TO_MAIN else call[f"{key}_rx"]
            # The first Session frame contains the low bytes; with one byte of data, the next frame
            # contains the rest.
            if _session(opener, fresh=True) is not None:
                first = call
                chunk = sent[: min(2, *self._link.sizes)]
                call[f"{key}_session_id"] = int.from_bytes(chunk, "little")
            elif first is not None and min(self._link.sizes) == 1:
                first[f"{key}_session_id"] |= sent[0] << 8
                first = None


def _session(text: str | None, *, fresh: bool = False) -> bytes | None:
    """Return the data of a Session frame; with ``fresh``, only of one that opens a session."""
    frame = bytes.fromhex(text or "")
    if not is_frame_length(len(frame)) or frame[0] != Command.SESSION:
        return None
    pdu = decode_pdu(frame)
    return pdu.safe_data if not fresh or fits_start(pdu) else None


def _us(ns: int) -> int | float:
    return ns // 1000 if ns % 1000 == 0 else ns / 1000
