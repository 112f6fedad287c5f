"""Seeded failures: each makes an incident file whose cause is known to the test alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from incident.seeds_bus import BUS, HEALTHY
from incident.seeds_devices import DEVICES
from incident.seeds_start import START, alone, start
from incident.seeds_symptoms import SYMPTOMS
from incident.seeds_tried import TRIED
from incident.seeds_wiring import WIRING

SEEDS = WIRING | DEVICES | BUS | START | TRIED | SYMPTOMS

# What shall name nothing.
NOTHING: dict[str, Callable[[Path], Path]] = HEALTHY | {
    "refused for an unknown reason": start("IMAGE", "out of memory"),
    "a SubDevice is missing, none is named": alone("MISSING", None),
}
