"""A small ``fsn-master``, which answers every request of control-protocol.md from memory."""

from __future__ import annotations

import contextlib
import json
import shlex
import shutil
import socket
import tempfile
import threading
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from types import TracebackType
from typing import Any

from fsoe_net.core.snapshot import Statistics

Row = dict[str, Any]

DIRECTION: Row = {
    "command": 0x36, "connection_id": 1, "reset_code": 0, "frames": 7, "process_data": 5,
    "failsafe_data": 0, "right": 7, "wrong": 0, "unchecked": 0, "resets": 0, "last_new_ns": 1,
    "interval_last_ns": 1, "interval_min_ns": 1, "interval_sum_ns": 2, "interval_max_ns": 1,
    "intervals": 2,
}  # fmt: skip
STATUS: Row = {
    "fault": None, "backend": "soem", "interface": "eth1", "redundant": None, "xdp": False,
    "plan": "a.fsnplan", "plan_sha256": "00", "accepted": False, "uptime_ns": 1,
    "cycle_ns": 1_000_000, "free_run": False, "policy": "fifo", "priority": 80, "cpu": None,
    "cycles": 5, "overruns": 0, "wkc_errors": 0, "expected_wkc": 9, "actual_wkc": 9,
    "realtime": True, "locked": True,
    "subdevices": {"planned": 2, "in_op": 2, "missing": 0}, "ring": None, "clocks": None,
    "standby": None, "clients": 1,
}  # fmt: skip
_HISTOGRAM: Row = {
    "count": 2, "sum_ns": 2_000_000, "min_ns": 990_000, "max_ns": 1_010_000,
    "percentiles_ns": {"p50": 1_000_000, "p99": 1_010_000, "p999": 1_010_000},
    "buckets": [[999_424, 2]],
}  # fmt: skip
_VALUES = {"int": 0, "bool": True, "Histogram": _HISTOGRAM}
STATISTICS: Row = {f.name: _VALUES[str(f.type)] for f in fields(Statistics)}
SUBDEVICE: Row = {
    "name": "drive_1", "alias": 0, "position": 0, "known": True, "al": "OP", "al_code": 0,
    "found": 2, "found_text": "the SubDevice of the plan", "detail": "", "vendor_id": 2,
    "product_code": 3, "revision": 1, "fsoe_address": 0, "link_down": False, "returns": 0,
    "stale_cycles": 0, "link": [1], "link_lost": [0],
    "rx_errors": [0],
}  # fmt: skip
LAYOUT: Row = {
    "image_bytes": 12,
    "sms": [{"subdevice": "drive_1", "sm": 2, "direction": "output", "byte": 0, "bytes": 6}],
    "datagrams": [{"byte": 0, "bytes": 12}],
    "copies": [{"source_byte": 0, "destination_byte": 6, "bytes": 6}],
    "connections": [
        {
            "name": "c1", "main": "logic", "sub": "drive_1", "address": 1, "connection_id": 2,
            "watchdog_ms": None, "to_sub": {"source_byte": 0, "destination_byte": 6, "bytes": 6},
            "to_main": {"source_byte": 6, "destination_byte": 0, "bytes": 6},
        }
    ],
}  # fmt: skip
MESSAGE: Row = {
    "id": 1, "flags": 2, "time_ns": 3_000_000, "text_id": 0x10, "kind": "warning",
    "parameters": [7], "data": "00ff",
}  # fmt: skip
SCAN: Row = {
    "scan": 1, "utc": "2026-01-01T00:00:00Z", "interface": "eth1", "backend": "soem",
    "states_changed": False,
    "subdevices": [{"position": 0, "alias": 0, "vendor_id": 1, "product_code": 2, "al": "OP"}],
}  # fmt: skip


def _symbol(name: str, kind: str, bits: int, *, output: bool = True, **more: object) -> Row:
    subdevice, _, entry = name.partition(".")
    index, subindex = entry.split(":") if entry.startswith("0x") else ("0", "0")
    row: Row = {
        "name": name, "subdevice": subdevice, "direction": "output" if output else "input",
        "index": int(index, 16), "subindex": int(subindex, 16), "type": kind, "bits": bits,
        "open": output, "factor": 1.0, "offset": 0.0,
    }  # fmt: skip
    if output:
        row |= {"restart_relevant": False, "stop_value": 0, "client": None}
    return row | more


class FakeMaster:
    """A control socket that is served until `close`; a context manager.

    It has a safety logic, two drives and one connection, all in Data. Values set by a client are
    read back afterwards.

    Args:
        path: Path of the socket; default: in a folder removed at the end of the ``with`` block.

    Attributes:
        path: Path of the socket.
        asked: Every request as a line, except those that renew a lease.
        renewed: Set after a lease was renewed.
        access: Role that ``hello`` reports: ``observer``, ``operator`` or ``maintainer``.
        state: State reported by ``status``: ``running``, ``stopped`` and so on.
        refuse: Request to ``{"error": ..., "text": ...}``: the refusal to send.
        symbols: Symbols listed by ``symbols``.
        inputs: Name of an input to its value.
        outputs: Name of an output to its value.
        connection_state: State of the connection; 6 is Data, ProcessData.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._folder: Path | None = None
        if path is None:
            # The path of a socket must be short.
            self._folder = Path(tempfile.mkdtemp(prefix="fsn-"))
            path = self._folder / "s"
        self.path = path
        self.access, self.state = "maintainer", "running"
        self.asked: list[str] = []
        self.renewed = threading.Event()
        self.refuse: dict[str, Row] = {}
        self.symbols = [
            _symbol("logic.ack", "bool", 1, restart_relevant=True),
            *(_symbol(f"drive_{n}.0x6040:00", "unsigned", 16) for n in (1, 2)),
            *(_symbol(f"drive_{n}.0x6041:00", "unsigned", 16, output=False) for n in (1, 2)),
            _symbol("drive_1.position", "signed", 32, index=0x607A, factor=0.5),
            _symbol("drive_1.position", "signed", 32, output=False, index=0x6064, factor=0.5),
        ]
        self.inputs: Row = {s["name"]: 0 for s in self.symbols if s["direction"] == "input"}
        self.outputs: Row = {s["name"]: 0 for s in self.symbols if s["direction"] == "output"}
        self.inputs["drive_1.0x6041:00"] = 0x27
        self.connection_state = 6
        self._clients = 0
        self._peers: dict[socket.socket, bool] = {}
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self) -> FakeMaster:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self.close()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def drop(self) -> None:
        """Break every connection."""
        for peer in list(self._peers):
            with contextlib.suppress(OSError):
                peer.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Break every connection and stop serving."""
        with contextlib.suppress(OSError):  # a test may already have closed it
            self._listener.shutdown(socket.SHUT_RDWR)
            self._listener.close()
        self.drop()

    def send_event(self, **event: object) -> None:
        """Send an event to every subscribed client."""
        row = {"utc": "U", "level": "info", "text": ""} | event
        line = json.dumps(row).encode() + b"\n"
        for peer, subscribed in list(self._peers.items()):
            if subscribed:
                with contextlib.suppress(OSError):
                    peer.sendall(line)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                peer, _ = self._listener.accept()
                self._clients += 1
                self._peers[peer] = False
                threading.Thread(
                    target=self._serve, args=(peer, self._clients), daemon=True
                ).start()

    def _serve(self, peer: socket.socket, number: int) -> None:
        with peer, contextlib.suppress(OSError), peer.makefile("rb") as lines:
            for raw in lines:
                words = shlex.split(raw.decode())
                if words[0] == "hello":
                    self.renewed.set()
                else:
                    self.asked.append(" ".join(words))
                reply = self._reply(peer, number, words)
                rows = [json.dumps(reply, separators=(",", ":"))]
                if reply.get("watch"):
                    rows += [json.dumps(row) for row in self._watched(words)]
                # All at once: a reply and its related messages must not be separated.
                peer.sendall("".join(f"{row}\n" for row in rows).encode())
                self._after(words)
        self._peers.pop(peer, None)
        for row in self.symbols:
            if row.get("client") == number:
                row["client"] = None
                self.outputs[row["name"]] = row["stop_value"]

    def _reply(self, peer: socket.socket, number: int, words: Sequence[str]) -> Row:
        name, rest = words[0], [w for w in words[1:] if not w.startswith("--")]
        if name in self.refuse:
            return {"ok": False, **self.refuse[name]}
        if name == "events":
            self._peers[peer] = rest == ["on"]
        if name == "watch":
            return self._watch(words[1], rest[1:], image="--image" in words)
        if name == "set":
            closed = self._set(rest, number)
            if closed:
                return {"ok": False, "error": "FSN_E_CLOSED", "text": f"{closed} is closed"}
        hello: Row = {"protocol": 1, "client": number, "lease_ms": 1000, "access": self.access}
        answers: Row = {
            "hello": hello,
            "status": STATUS | {"state": self.state},
            "symbols": {"symbols": self.symbols},
            "subdevices": {"subdevices": [self._device("drive_1", 0), self._device("drive_2", 1)]},
            "snapshot": {
                "connections": [self._connection()],
                "statistics": STATISTICS,
                "subdevices": [SUBDEVICE],
            },
            "get": {"cycle": 9, **self._values(rest)},
            "set": {"set": len(rest)},
            "arm": {"armed": True, "for_ms": 10_000},
            "lease": {"lease_ms": int(rest[0]) if name == "lease" else 0},
            "layout": LAYOUT,
            "sdo-read": {"data": "2702", "bytes": 2, "value": 0x227},
            "sii-read": {"data": "00112233" * 8},
            "history": {"messages": [MESSAGE]},
            "scan": SCAN,
            "incident": {"file": "x.fsnincident"},
        } | {
            n: {"state": self.state}
            for n in ("start", "stop", "restart", "shutdown", "hold", "resume")
        }
        found: Row = answers.get(name, {})
        return {"ok": True} | found

    def _watch(self, every: str, words: Sequence[str], *, image: bool) -> Row:
        if every == "off":
            return {"ok": True, "watch": 0}
        for word in words:
            if not self._chosen([word]):
                verb = "begins with" if word.endswith("*") else "is called"
                text = f"no input or output {verb} {word.removesuffix('*')}"
                hint = "symbols lists the names"
                return {"ok": False, "error": "FSN_E_ARG", "text": text, "hint": hint}
        count = 0 if image else sum(map(len, self._values(self._chosen(words)).values()))
        return {"ok": True, "watch": int(every), "values": count, "image": image}

    def _chosen(self, words: Sequence[str]) -> list[str]:
        """Return the names for ``watch``, in the order of the symbols; all if there is no word."""
        starts = tuple(word.removesuffix("*") for word in words or ["*"] if word.endswith("*"))
        names = dict.fromkeys(str(s["name"]) for s in self.symbols)
        return [name for name in names if name in words or name.startswith(starts)]

    def _values(self, names: Sequence[str]) -> Row:
        sides = {"inputs": self.inputs, "outputs": self.outputs}
        return {side: {n: v[n] for n in names if n in v} for side, v in sides.items()}

    def _set(self, pairs: Sequence[str], number: int) -> str:
        """Set values for a client; return the name of a closed output, or an empty string."""
        for pair in pairs:
            target, _, value = pair.rpartition("=")
            outputs = (r for r in self.symbols if r["direction"] == "output")
            row = next((r for r in outputs if r["name"] == target), None)
            if row is None or not row["open"]:
                return target
            is_number = value[:1].isdigit() and "." not in value
            self.outputs[target] = int(value, 0) if is_number else value
            row["client"] = number
        return ""

    def _watched(self, words: Sequence[str]) -> Iterator[Row]:
        """Yield watched cycles, after the reply."""
        names = self._chosen([w for w in words[2:] if not w.startswith("--")])
        for cycle in (10, 20, 50):
            row: Row = {"event": "values", "cycle": cycle, "now_ns": cycle, **self._values(names)}
            if "--image" in words:
                row = {"event": "image", "cycle": cycle, "now_ns": cycle, "image": "0aff"}
                row |= {"expected_wkc": 3, "actual_wkc": 2}
            row |= {"skipped": 2} if cycle == 50 else {}
            yield row

    def _after(self, words: Sequence[str]) -> None:
        """Send messages after a reply: changes of the state."""
        steps = {"start": ["opening", "running"], "stop": ["stopping", "stopped"]}
        steps["restart"] = steps["stop"] + steps["start"]
        for state in steps.get(words[0], []) if words[0] not in self.refuse else []:
            self.state = state
            self.send_event(event="state", state=state)

    def _connection(self) -> Row:
        return {
            "name": "c1", "net": "n", "main": "logic", "sub": "drive_1", "gaps": 0,
            "observed_state": self.connection_state, "to_sub": DIRECTION, "to_main": DIRECTION,
        }  # fmt: skip

    @staticmethod
    def _device(name: str, position: int) -> Row:
        identity = {"vendor_id": 1, "product_code": 2, "revision": 3}
        return SUBDEVICE | {"name": name, "position": position} | identity
