"""Seeded failures: each makes an incident file whose cause is known to the test alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from incidents.seeds_bus import BUS, HEALTHY
from incidents.seeds_devices import DEVICES
from incidents.seeds_start import START, alone, start
from incidents.seeds_symptoms import SYMPTOMS
from incidents.seeds_tried import TRIED
from incidents.seeds_wiring import WIRING

SEEDS = WIRING | DEVICES | BUS | START | TRIED | SYMPTOMS

# What shall name nothing.
NOTHING: dict[str, Callable[[Path], Path]] = HEALTHY | {
    "refused for an unknown reason": start("IMAGE", "out of memory"),
    "a SubDevice is missing, none is named": alone("MISSING", None),
}
