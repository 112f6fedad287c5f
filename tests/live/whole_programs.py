"""Programs on a made-up bus, and what they refuse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fsoe_net.errors import FsnError


def refusal(call: Any, *words: Any) -> str:
    with pytest.raises(FsnError) as caught:
        call(*words)
    return str(caught.value)


def program(folder: Path, text: str) -> str:
    path = folder / "fsn-master"
    path.write_text(f"#!/bin/sh\n{text}\n", "utf-8")
    path.chmod(0o755)
    return str(path)
