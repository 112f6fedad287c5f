"""Judges the reaction of two ends to a fault, using only their frames and application data."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from fsoe_net.campaign.channel import Way, short_hex
from fsoe_net.campaign.clean_run import Scene
from fsoe_net.campaign.collision_proof import Collision, CollisionProof, collision
from fsoe_net.campaign.departure import frame_text
from fsoe_net.campaign.injection import Injection
from fsoe_net.fsoe.pdu import Command, decode_pdu

_RESET, _SESSION = int(Command.RESET), int(Command.SESSION)
_PROCESS_DATA = int(Command.PROCESS_DATA)
_DATA = (int(Command.PROCESS_DATA), int(Command.FAIL_SAFE_DATA))
_MISWIRED_CYCLES = 20_000  # more than the start-up with the longest usual parameters
_ENDS = ("sub", "main")


class TrialOutcome(enum.Enum):
    """Outcome of a fault."""

    DETECTED = "detected"
    """An end left its state: Reset, new Session, watchdog."""
    TOLERATED = "tolerated"
    """No end had to detect it, and none did: the correct frames continued."""
    COLLISION = "collision"
    """A wrong frame was accepted because its CRCs match by accident, as a computation proves."""
    WRONGLY_ACCEPTED = "wrongly_accepted"
    """A wrong frame was accepted without a CRC collision, or wrong or old data were valid."""
    WRONG_REACTION = "wrong_reaction"
    """An end deviated from its state table: no Reset, another code, too early, too late."""


FAILURES = (TrialOutcome.WRONGLY_ACCEPTED, TrialOutcome.WRONG_REACTION)


@dataclass(slots=True, kw_only=True)  # not frozen: millions of instances
class TrialFinding:
    """Outcome of one fault.

    Attributes:
        verdict: The verdict.
        code: Code of the Reset by which it was detected; ``None`` for a new Session or none.
        latency_ns: From the first wrong image after the last correct frame to the frame with which
            an end leaves its state; 0 if the image is rejected in the call that reads it.
        exposed: Whether only the CRC protected against the first wrong frame.
        reason: The wrong acceptance, for people.
        proof: Proof of a collision.
    """

    verdict: TrialOutcome
    code: int | None = None
    latency_ns: int = 0
    exposed: bool = False
    reason: str = ""
    proof: Collision | None = None


class _Run:
    """The time from the first wrong image until the verdict is clear."""

    def __init__(self, scene: Scene, injection: Injection, watchdog_ns: int) -> None:
        self.channel = channel = scene.channel
        channel.faults = injection.faults
        self.over = channel.cycle
        for fault in injection.faults:
            self.over = max(self.over, fault.until)
        # Three watchdogs and some cycles: by then each end must have reacted.
        self.limit = self.over + 3 * scene.watchdog_cycles + 64
        self.watchdog_ns = watchdog_ns
        # Data that were valid before the fault may be held until the watchdog expires.
        self.known = [end.received_safe_data if end.data_valid else None for end in channel.ends]
        if injection.application is not None:
            channel.application = injection.application
        self.injection = injection
        self.patient, self.miswired = injection.patient, injection.miswired
        if self.miswired:
            # A miswired network never recovers: the whole run counts.
            self.over = self.limit = channel.cycle + _MISWIRED_CYCLES
        self.settled: set[Way] = set()
        self.started_ns: int | None = None
        self.begun, self.exposed = False, injection.former
        self.quiet = 0

    def finding(self) -> TrialFinding:
        stays, first = self.injection.stays, None
        while self.channel.cycle < self.limit:
            found = self._turn()
            # A persistent fault may be detected more than once; the judgement ends with the fault.
            if stays and found is not None and found.verdict is TrialOutcome.DETECTED:
                first = first or found
                found = None
            if stays and first is not None and self.channel.cycle >= self.over:
                return first
            if found is not None:
                both = self.patient and found.verdict is TrialOutcome.DETECTED
                return self._both_ends(found) if both else found
        return self._found(TrialOutcome.DETECTED)  # silent, and no valid data

    def _both_ends(self, found: TrialFinding) -> TrialFinding:
        """Continue until the other end has given up its data as well."""
        ends = self.channel.ends
        for end in ends:
            # The other end must not use data for longer than its watchdog.
            while end.data_valid and self.channel.cycle < self.limit:
                later = self._turn()
                if later is not None and later.verdict in FAILURES:
                    return later
        return found

    def _found(
        self, verdict: TrialOutcome, code: int | None = None, reason: str = ""
    ) -> TrialFinding:
        started = self.turn_ns if self.started_ns is None else self.started_ns
        return TrialFinding(
            verdict=verdict,
            code=code,
            latency_ns=self.turn_ns - started,
            exposed=self.exposed,
            reason=reason,
        )

    def _turn(self) -> TrialFinding | None:
        found = self._judged_turn()
        departed = self.channel.departed
        if departed is None or (found is not None and found.verdict in FAILURES):
            return found
        way, departure = departed
        verdict = (
            TrialOutcome.WRONGLY_ACCEPTED if departure.accepted else TrialOutcome.WRONG_REACTION
        )
        return self._found(verdict, reason=f"the {_ENDS[way]}: {departure.text}")

    def _judged_turn(self) -> TrialFinding | None:
        channel = self.channel
        way = channel.way
        self.turn_ns = channel.now_ns
        if self.started_ns is None:
            shown, sent = self._first_turns(way)
        else:
            shown, sent = channel.turn()
        end = channel.ends[way]
        if sent is None:
            # The image has not changed: an end that repeats its frame has not answered.
            self.quiet += 1
            if end.data_valid:
                found = self._held(way, end.received_safe_data)
                if found is not None:
                    return found
            if self.quiet > 1 and channel.way is Way.TO_MAIN:  # mutants: only saves calls
                channel.skip_idle()
            return None
        self.quiet = 0
        found = self._answered(way, shown, sent)
        if found is None and end.data_valid:
            found = self._data(way, end.received_safe_data)
        # An end that resets must withdraw its data in the same call.
        elif found is not None and found.verdict is TrialOutcome.DETECTED and end.data_valid:
            return self._wrong(way, "data valid after the end has left state Data")
        return found

    def _first_turns(self, way: Way) -> tuple[bytes | None, bytes | None]:
        """Run one end and record whether it receives something wrong after correct frames."""
        channel = self.channel
        before, clean = channel.shown(way), channel.image(way, channel.cycle)
        shown, sent = channel.turn()
        if shown != clean:
            self.started_ns = self.turn_ns
            if not self.begun:
                self.begun = True
                self.exposed = self.exposed or _exposed(shown, clean, before)
        return shown, sent

    def _answered(self, way: Way, shown: bytes | None, sent: bytes) -> TrialFinding | None:
        """Judge a frame sent in answer to a faulty image."""
        due = self.channel.newest(way)
        # 0x2a is the command of a Reset; the frame may be too short to decode.
        to_reset = shown is not None and shown[:1] == b"\x2a"
        usual_reset = to_reset and due is not None and due[0] == _RESET
        if sent[0] == _RESET:
            # An answer to a Reset is not a detection of the fault.
            if usual_reset and sent[1] == 0:
                return None  # the acknowledgement of its own Reset
            return self._found(TrialOutcome.DETECTED, sent[1])
        if sent[0] == _SESSION and self._restarts(way, shown, due, usual_reset):
            return self._found(TrialOutcome.DETECTED)
        # The usual continuation: the fault was not visible to this end.
        if shown == due or (sent[0] == _SESSION and (usual_reset or way is Way.TO_SUB)):
            return self._settled(way)
        return None if self.injection.signed else self._accepted(way, shown, due)

    def _restarts(
        self, way: Way, shown: bytes | None, due: bytes | None, usual_reset: bool
    ) -> bool:
        """Whether a Session frame shows that the connection was restarted."""
        if due is None or shown is None:
            return True
        if way is Way.TO_SUB:
            return due[0] != _SESSION
        return not usual_reset and shown[0] != _SESSION  # a Reset, or the watchdog in state Reset

    def _accepted(self, way: Way, shown: bytes | None, due: bytes | None) -> TrialFinding:
        """Judge an end that continued after an unexpected frame: was it required to do so?"""
        channel = self.channel
        replayed = CollisionProof(
            channel.base[way],
            is_main=way is Way.TO_MAIN,
            exchanges=channel.exchanges[way][:-1],
        )
        if replayed.chain is not None and shown is not None and due is not None:
            # For a frame of a former session, the expected frame is the one that was sent then.
            right = shown if self.injection.former else due
            proof = collision(replayed.chain, _ENDS[way], shown, right)
            if proof is not None:
                found = self._found(TrialOutcome.COLLISION)
                found.proof = proof
                return found
        # A CRC collision does not explain it: the end has accepted a wrong frame.
        return self._wrong(way, f"accepted {frame_text(shown)} instead of {frame_text(due)}")

    def _settled(self, way: Way) -> TrialFinding | None:
        if self.channel.cycle <= self.over:
            self.started_ns = None  # everything in time so far
            return None
        self.settled.add(way)  # one right frame accepted at each end after the fault
        return self._found(TrialOutcome.TOLERATED) if len(self.settled) == len(_ENDS) else None

    def _data(self, way: Way, data: bytes) -> TrialFinding | None:
        """Check that valid data after a right frame are those of the frame."""
        if self.miswired:
            return self._wrong(way, "valid data from an end it does not belong to")
        self.known[way] = data
        due = self.channel.newest(way)
        if due is not None and due[0] == _PROCESS_DATA and decode_pdu(due).safe_data == data:
            return None
        return self._wrong(way, f"valid data {short_hex(data)} were not sent")

    def _held(self, way: Way, data: bytes) -> TrialFinding | None:
        """Check that valid data stay unchanged between answers, at most for the watchdog time."""
        if data != self.known[way]:
            return self._wrong(way, f"took data {short_hex(data)} without an answer")
        age_ns = self.turn_ns - self.channel.answered_ns[way]
        # An end checks its watchdog once per bus cycle.
        if age_ns >= self.watchdog_ns + self.channel.cycle_ns:
            return self._wrong(way, f"data still valid after {age_ns / 1e6:g} ms")
        return None

    def _wrong(self, way: Way, text: str) -> TrialFinding:
        return self._found(TrialOutcome.WRONGLY_ACCEPTED, reason=f"the {_ENDS[way]}: {text}")


def _exposed(shown: bytes | None, clean: bytes | None, before: bytes | None) -> bool:
    """Whether a data frame with the right ConnID and length is delivered in place of another."""
    return (
        shown is not None
        and clean is not None
        and shown != before
        and len(shown) == len(clean)
        and shown[0] in _DATA
        and clean[0] in _DATA
        and shown[-2:] == clean[-2:]
    )


def judge(scene: Scene, injection: Injection, watchdog_ns: int) -> TrialFinding:
    """Inject a fault into a channel and watch both ends until the verdict is clear.

    Args:
        scene: The point of injection; its channel cannot be reused.
        injection: The fault.
        watchdog_ns: Watchdog of the connection in ns.
    """
    return _Run(scene, injection, watchdog_ns).finding()
