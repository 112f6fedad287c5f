"""Recorded runs (§13): reading them, and holding them against the engine."""

from fsoe_net.fsoe.recording.replay import Difference, ReplayResult, replay, replay_file
from fsoe_net.fsoe.recording.rows import file_lines

__all__ = ["Difference", "ReplayResult", "file_lines", "replay", "replay_file"]
