"""A server that answers as ``fsn-master`` with one connection; tests change it as it runs."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import socket
import threading

from fsoe_net.core.snapshot import Statistics

HISTOGRAMS = ("latency", "period", "work", "copy", "round_trip", "dc_offset")
MS = 1_000_000


def histogram(*buckets):
    count = sum(n for _, n in buckets)
    top = buckets[-1][0] if buckets else 0
    shares = {"p50": top, "p90": top, "p99": top, "p999": top, "p9999": top}
    return {
        "count": count, "sum_ns": top * count, "min_ns": 1, "max_ns": top,
        "percentiles_ns": shares, "buckets": [list(b) for b in buckets],
    }  # fmt: skip


def direction(**more):
    return {
        "command": 0x36, "connection_id": 7, "reset_code": 0, "frames": 50, "process_data": 40,
        "failsafe_data": 5, "right": 50, "wrong": 0, "unchecked": 0, "resets": 1,
        "last_new_ns": 995 * MS, "interval_last_ns": 4 * MS, "interval_min_ns": 3 * MS,
        "interval_sum_ns": 400 * MS, "interval_max_ns": 90 * MS, "intervals": 100,
    } | more  # fmt: skip


def subdevice(name, **more):
    return {
        "name": name, "alias": 0, "position": 0, "known": True, "al": "OP", "al_code": 0,
        "found": 2, "detail": "", "vendor_id": 1, "product_code": 2, "revision": 3,
        "fsoe_address": 0, "link_down": False,
        "returns": 0, "stale_cycles": 2, "link": [1, 0], "link_lost": [0, 0], "rx_errors": [0, 0],
    } | more  # fmt: skip


class WatchedMaster:
    """Serves until `close`. ``images``: what ``watch`` tells."""

    def __init__(self, path):
        self.path = path
        self.state = "running"
        self.in_cycle = []
        self.wire = {"observed_state": 6, "gaps": 0, "to_sub": direction(), "to_main": direction()}
        self.subdevices = [subdevice("logic"), subdevice("drive")]
        self.layout = {"image_bytes": 6, "sms": [], "datagrams": [], "copies": []}
        self.watchdog_ms = 100
        self.images = []
        self.known = {"hello", "events", "status", "snapshot", "layout", "watch"}
        self.subscribed = threading.Event()
        self._peers = []
        self._threads = []
        self._open()

    def _open(self):
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(self.path))
        self._listener.listen()
        self._accepting = threading.Thread(target=self._accept, args=(self._listener,), daemon=True)
        self._accepting.start()

    def _accept(self, listener):
        with contextlib.suppress(OSError):
            while True:
                peer, _ = listener.accept()
                self._peers.append(peer)
                thread = threading.Thread(target=self._serve, args=(peer,), daemon=True)
                self._threads.append(thread)
                thread.start()

    def _serve(self, peer):
        with contextlib.suppress(OSError, ValueError), peer, peer.makefile("rb") as lines:
            for line in lines:
                words = line.decode().split()
                for document in self._answers(words):
                    peer.sendall(json.dumps(document).encode() + b"\n")
                if words[0] == "events":
                    self.subscribed.set()

    def _answers(self, words):
        word = words[0]
        if word not in self.known:
            return [{"ok": False, "error": "FSN_E_ARG", "text": f"no request {word}"}]
        if word == "snapshot" and self.state != "running":
            return [{"ok": False, "error": "FSN_E_STATE", "text": "the bus is stopped"}]
        rows = [{"ok": True} | getattr(self, f"_{word}", dict)()]
        if word == "watch" and words[1] != "off":
            rows += self.images
        return rows

    def _hello(self):
        return {"program": "fsn-master", "protocol": 1}

    def _status(self):
        return {
            "state": self.state, "fault": None, "backend": "soem", "interface": "no-such-if",
            "redundant": None, "xdp": False, "plan": "a.fsnplan", "plan_sha256": "00",
            "accepted": False, "uptime_ns": 1, "clients": 1, "cycle_ns": MS, "free_run": False,
            "policy": "fifo", "priority": 80, "cpu": None, "cycles": 5, "overruns": 0,
            "wkc_errors": 0, "expected_wkc": 6, "actual_wkc": 6, "realtime": True, "locked": True,
            "subdevices": {"planned": 2, "in_op": 2, "missing": 0},
            "interventions": {"entry": 33, "hash": "ab" * 32, "error": None},
            "in_cycle": self.in_cycle,
        }  # fmt: skip

    def _snapshot(self):
        statistics = {f.name: 0 for f in dataclasses.fields(Statistics)}
        statistics |= {name: histogram() for name in HISTOGRAMS} | {"now_ns": 1000 * MS}
        statistics["latency"] = histogram((8_000, 10), (16_000, 5), (2_000_000, 1))
        statistics |= {"cycles": 1000, "expected_wkc": 6, "actual_wkc": 6}
        statistics |= {"realtime": True, "locked": True}
        names = {"name": "c1", "net": "n", "main": "logic", "sub": "drive"}
        return {
            "statistics": statistics,
            "connections": [names | self.wire],
            "subdevices": self.subdevices,
        }

    def _layout(self):
        copy = {"source_byte": 0, "destination_byte": 0, "bytes": 6}
        row = {
            "name": "c1", "main": "logic", "sub": "drive", "address": 5, "connection_id": 7,
            "watchdog_ms": self.watchdog_ms, "to_sub": copy, "to_main": copy,
        }  # fmt: skip
        return self.layout | {"connections": [row]}

    def tell(self, **event):
        """Send an event to everybody."""
        for peer in list(self._peers):
            with contextlib.suppress(OSError):
                peer.sendall(json.dumps(event).encode() + b"\n")

    def close(self):
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._accepting.join()
        for peer in self._peers:
            with contextlib.suppress(OSError):
                peer.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        self._peers, self._threads = [], []
        self.path.unlink(missing_ok=True)
        self.subscribed.clear()

    def reopen(self):
        """Be there again, as another process."""
        self._open()
