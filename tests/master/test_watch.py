"""Cycles through the control socket: every one, whole, to several clients, and never waited for."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import pytest
from master.rig import Client, running
from patience import PATIENCE_S

from fsoe_net.testing.fake_master import FakeMaster

MODE = "drive_1.0x6060:00"  # int8, stop value 8
LAMP = "el2904.standard_1"


def lines(client: Client, event: str, count: int) -> list[dict[str, Any]]:
    return [client.event(event) for _ in range(count)]


def place(layout: dict[str, Any], byte: int, size: int) -> str:
    """Return which sync manager holds these bytes of the image, and in which direction."""
    (found,) = [
        sm for sm in layout["sms"] if sm["byte"] <= byte and byte + size <= sm["byte"] + sm["bytes"]
    ]
    return f"{found['subdevice']} {found['direction']}"


def test_every_nth_cycle_comes_once_with_its_values() -> None:
    with running() as master, master.client() as client, master.client() as other:
        assert client.good("watch 1")["watch"] == 1
        assert other.good(f"watch 3 {MODE} el2904.*")["values"] > 1
        for watcher, every in ((client, 1), (other, 3)):
            found = lines(watcher, "values", 50)
            cycle = found[0]["cycle"]
            for line in found[1:]:
                assert line["cycle"] == cycle + every * (1 + line.get("skipped", 0))
                cycle = line["cycle"]
            times = [line["now_ns"] for line in found]
            assert times == sorted(set(times))
        symbols = client.good("symbols")["symbols"]
        for side in ("input", "output"):
            names = {s["name"] for s in symbols if s["direction"] == side}
            assert set(client.event("values")[f"{side}s"]) == names
            some = {n for n in names if n == MODE or n.startswith("el2904.")}
            assert set(other.event("values")[f"{side}s"]) == some
        assert client.good("watch off")["watch"] == 0
        client.events.clear()
        client.good("hello")
        assert not client.events


def test_values_of_one_set_are_in_one_cycle() -> None:
    with running() as master, master.client() as client, master.client() as watcher:
        watcher.good(f"watch 1 {MODE} {LAMP}")
        client.good("lease 0")
        for n in range(40):
            client.good(f"set {MODE}={n % 2} {LAMP}={n % 2}")
            values = {MODE: None}
            while values[MODE] != n % 2:
                values = watcher.event("values")["outputs"]
                if values[MODE] in (0, 1):
                    assert values[LAMP] is (values[MODE] == 1)


def test_images_fit_the_layout() -> None:
    with running() as master, master.client() as client:
        client.good("lease 0")
        client.good(f"set {MODE}=-3")
        client.good("watch 1 --image")
        layout = client.good("layout")
        line = lines(client, "image", 5)[-1]
        image = bytes.fromhex(line["image"])
        assert len(image) == layout["image_bytes"]
        assert line["expected_wkc"] == sum(d["expected_wkc"] for d in layout["datagrams"])
        assert sum(d["bytes"] for d in layout["datagrams"]) == layout["image_bytes"]
        (mode,) = [
            s for s in layout["sms"] if (s["subdevice"], s["direction"]) == ("drive_1", "output")
        ]
        assert 0xFD in image[mode["byte"] : mode["byte"] + mode["bytes"]]
        assert len(layout["connections"]) == 4
        for connection in layout["connections"]:
            main, sub = connection["main"], connection["sub"]
            for way, source, destination in (("to_sub", main, sub), ("to_main", sub, main)):
                copy = connection[way]
                assert place(layout, copy["source_byte"], copy["bytes"]) == f"{source} input"
                assert place(layout, copy["destination_byte"], copy["bytes"]) == (
                    f"{destination} output"
                )
                assert any(
                    all(c[key] == copy[key] for key in ("source_byte", "destination_byte", "bytes"))
                    for c in layout["copies"]
                )


@pytest.mark.shows("R26")
def test_a_watcher_that_does_not_read_misses_lines_without_effect_on_others() -> None:
    with running("--cycle", "200us") as master, master.client() as slow, master.client() as client:
        slow.good("watch 1")
        before = client.good("status")["cycles"]
        while client.good("status")["cycles"] < before + 8000:
            pass
        first = slow.event("values")["cycle"]
        total = 1
        while True:
            line = slow.event("values")
            total += 1 + line.get("skipped", 0)
            assert line["cycle"] == first + total - 1
            if line.get("skipped", 0) > 0:
                break
        slow.good("watch off")


def test_watching_continues_over_a_restart() -> None:
    with running() as master, master.client() as client:
        client.good(f"watch 1 {MODE}")
        # Enough that the first line after it has a smaller number, however late it comes.
        while (before := client.event("values")["cycle"]) < 2000:
            pass
        client.good("restart")
        while (now := client.event("values")["cycle"]) > before:
            before = now
        assert client.good("watch off")["watch"] == 0


def test_without_a_recorder_nothing_can_be_watched() -> None:
    with running("--record", "0") as master, master.client() as client:
        assert "no cycles are recorded" in client.refused("watch 1", "FSN_E_STATE")
        assert client.good("layout")["image_bytes"] > 0
        client.socket.settimeout(PATIENCE_S)
        client.good("stop")
        while client.good("status")["state"] != "stopped":
            pass
        client.refused("layout", "FSN_E_STATE")


def test_events_carry_the_time_of_a_cycle() -> None:
    """The cycle that left some out is known by its time, and it is one that was run."""
    with running() as master, master.client() as client:
        client.good("events on")
        client.good(f"watch 1 {MODE}")
        times = {line["now_ns"] for line in lines(client, "values", 300)}
        told = [e["now_ns"] for e in client.events if e["event"] == "wkc"]
        assert all(t in times for t in told if min(times) <= t <= max(times))


@pytest.mark.parametrize(
    "words", ["*", "", "drive_1.*", f"{MODE} el2904.*", f"drive_1.* {MODE}", "--typed *", "--image"]
)
def test_fake_master_watches_what_fsn_master_watches(words: str) -> None:
    with both_masters() as (client, fake):
        assert fake.ask(f"watch 1 {words}") == client.ask(f"watch 1 {words}")
        event = "image" if words == "--image" else "values"
        shown, expected = fake.event(event), client.event(event)
        for side in ("inputs", "outputs"):
            assert shown.get(side, {}).keys() == expected.get(side, {}).keys()


@pytest.mark.parametrize("words", ["off", "1 nothing", "1 nothing*", "1 drive_1.* nothing"])
def test_fake_master_refuses_a_watch_as_fsn_master_does(words: str) -> None:
    with both_masters() as (client, fake):
        assert fake.ask(f"watch {words}") == client.ask(f"watch {words}")


@contextlib.contextmanager
def both_masters() -> Iterator[tuple[Client, Client]]:
    """Give a client of an ``fsn-master`` and one of a `FakeMaster` with the same symbols."""
    with running() as master, master.client() as client, FakeMaster() as fake:
        fake.symbols = client.good("symbols")["symbols"]
        fake.inputs, fake.outputs = (
            {s["name"]: 0 for s in fake.symbols if s["direction"] == side}
            for side in ("input", "output")
        )
        with Client(fake.path) as other:
            yield client, other
