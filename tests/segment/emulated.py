"""The emulate command and its network."""

from __future__ import annotations

import sys

from wires import ROOT

ESTOP = str(ROOT / "examples" / "estop" / "network.yaml")
EMULATE = [sys.executable, "-m", "fsoe_net.cli", "emulate"]
