"""Recorded runs (§13): reading them, and holding them against the engine."""

from fsoe_net.fsoe.recording.replay import Difference, ReplayResult, replay, replay_file

__all__ = ["Difference", "ReplayResult", "replay", "replay_file"]
