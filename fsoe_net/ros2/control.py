"""Control of a bus by other nodes: set outputs, start and stop it. Only if allowed.

DDS has no users: every process in the domain has the permissions of this one. Therefore outputs
cannot be armed from here, and no output of a drive can be set: axes are moved by a real-time
client.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from fsoe_net.diag.printable import printable
from fsoe_net.errors import ControlRefused, EnvironmentFault
from fsoe_net.live.client import Client
from fsoe_net.live.control_values import BusState, Symbol, Value
from fsoe_net.ros2.diagnostics import RosLevel, RosStatus
from fsoe_net.ros2.values import Joint, SignalKind, SignalTopic

LEASE_MS = 1000
"""Silence of a process after which its outputs take their stop values."""
# Outputs that move the first axis of a drive (IEC 61800-7-201), and parts of such names.
_MOVES = frozenset({0x6040, 0x6060, 0x6071, 0x607A, 0x60FF})
_MOVES_BY_NAME = frozenset({"control_word", "controlword", "position", "velocity", "effort"})
_IDLE_S = 10.0
_MOST_SENDERS = 8  # of the 64 clients of fsn-master
_LONGEST_NAME = 100  # that is repeated in a message
_MOST_AT_ONCE = 256  # parameters of a request; no other request is served in the meantime


@dataclass(slots=True)
class _Sender:
    """A ROS process that sets outputs; it has its own client."""

    client: Client
    last_s: float


def settable(topics: Sequence[SignalTopic], joints: Sequence[Joint]) -> tuple[SignalTopic, ...]:
    """Return the outputs that nodes may set: open, not armed, and not of a drive."""
    actual = {joint.position for joint in joints}
    drives = {s.subdevice for t in topics if _is_of_drive(s := t.symbol, actual)}
    return tuple(t for t in topics if t.is_settable and t.symbol.subdevice not in drives)


def _is_of_drive(symbol: Symbol, actual: Collection[str]) -> bool:
    if not symbol.is_output:
        return symbol.name in actual
    return symbol.index in _MOVES or symbol.entry.lower() in _MOVES_BY_NAME


class NodeControl:
    """Executes requests of nodes with clients of the control socket; one thread at a time.

    Args:
        path: Control socket.

    Raises:
        EnvironmentFault: No process answers, or this user has only read permission.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._senders: dict[str, _Sender] = {}
        self._set = self._refused = 0
        self._last = ""
        with Client(path) as client:
            access = str(client.hello.get("access", ""))
        if access == "observer":
            raise EnvironmentFault(
                "--allow-control: your role at this fsn-master is observer, which only reads. "
                "The user who runs it gives another one: --allow-user NAME:operator may set "
                "outputs, NAME:maintainer also start and stop the bus"
            )
        self.access = access

    def close(self) -> None:
        """Disconnect; outputs take their stop values."""
        for sender in self._senders.values():
            sender.client.close()
        self._senders.clear()

    def set_output(self, topic: SignalTopic, message: Any, who: str) -> None:
        """Set an output to the value of a message; a refusal is shown in the status."""
        self._set_value(topic, topic.kind.python(message.data), who)

    def set_parameters(
        self, offered: Mapping[str, SignalTopic], request: Any, who: str
    ) -> list[tuple[bool, str]]:
        """Set the outputs in a request by name, each separately.

        Args:
            offered: Settable outputs, by name.
            request: A `fsoe_net.ros2.messages.SetParametersRequest`.
            who: The sender.

        Returns:
            For each output whether it was set, and if not, the reason.
        """
        # DDS has no users: a request of any size may come from anywhere.
        if len(request.parameters) > _MOST_AT_ONCE:
            text = self._refuse(f"more than {_MOST_AT_ONCE} parameters at once: nothing was set")
            return [(False, text)]
        refusals: list[str] = []
        fault = ""  # of the control socket: it is not waited for again
        for each in request.parameters:
            topic, value = offered.get(each.name), each.value.python()
            refusals.append(fault or self._set_parameter(topic, each.name, value, who))
            # One timeout is enough: a socket without an answer would block each further parameter.
            if refusals[-1] and topic is not None and who not in self._senders:
                fault = refusals[-1]
        return [(not text, text) for text in refusals]

    def _set_parameter(
        self, topic: SignalTopic | None, name: str, value: bool | float | None, who: str
    ) -> str:
        if topic is None:
            short = printable(name[:_LONGEST_NAME])
            return self._refuse(f"{short} is not an output that nodes may set")
        if value is None or not topic.kind.takes(value):
            return self._refuse(f"{name} takes a value as std_msgs/msg/{topic.kind.value} has it")
        return self._set_value(topic, topic.kind.python(value), who)

    def _set_value(self, topic: SignalTopic, value: Value, who: str) -> str:
        """Set an output; return the reason of a refusal, or an empty text."""
        self._forget_idle()
        try:
            client = self._client(who)
            client.set({topic.symbol.name: value}, typed=topic.kind is SignalKind.REAL)
            self._set += 1
        except ControlRefused as refused:
            return self._refuse(str(refused))
        except EnvironmentFault as fault:
            gone = self._senders.pop(who, None)
            if gone is not None:
                gone.client.close()
            return self._refuse(str(fault))
        return ""

    def bus_request(self, word: str) -> Callable[[Any, str], tuple[bool, str]]:
        """Return the action of a service: ``start``, ``stop`` or ``restart``."""
        requests: dict[str, Callable[[Client], BusState]] = {
            "start": Client.start,
            "stop": Client.stop,
            "restart": Client.restart,
        }
        return partial(self._request, word, requests[word])

    def status(
        self,
        answered: str,
        unreadable: int = 0,
        unanswered: int = 0,
        waiting: Sequence[str] = (),
    ) -> RosStatus:
        """Return completed and refused requests.

        Args:
            answered: Callers that services can answer.
            unreadable: Number of messages that could not be read.
            unanswered: Number of requests from callers that cannot be answered.
            waiting: Services that have callers which cannot be answered.
        """
        values = (
            ("role", self.access),
            ("outputs set", str(self._set)),
            ("refused", str(self._refused)),
            ("last refusal", self._last),
            ("unreadable", str(unreadable)),
            ("services answer", answered),
            ("not answered", str(unanswered)),
        )
        faults = [f"refused: {self._last}"] if self._refused else []
        if waiting:
            faults.append(f"callers of {', '.join(waiting)} need {answered}")
        return RosStatus(
            level=RosLevel.WARN if faults else RosLevel.OK,
            name="control",
            message="; ".join(faults) or "other nodes may set outputs",
            values=values,
        )

    def _request(
        self, word: str, request: Callable[[Client], BusState], *_: object
    ) -> tuple[bool, str]:
        try:
            with Client(self._path) as client:
                request(client)
            return True, f"{word} has begun"
        except EnvironmentFault as fault:
            return False, self._refuse(str(fault))

    def _client(self, who: str) -> Client:
        sender = self._senders.get(who)
        now_s = time.monotonic()
        if sender is None:
            if len(self._senders) >= _MOST_SENDERS:
                raise EnvironmentFault(f"more than {_MOST_SENDERS} processes set outputs")
            client = Client(self._path)
            try:
                client.lease(LEASE_MS)
            except EnvironmentFault:
                client.close()
                raise
            sender = self._senders[who] = _Sender(client, now_s)
        sender.last_s = now_s
        return sender.client

    def _forget_idle(self) -> None:
        """Disconnect clients of silent processes; their outputs have already fallen back."""
        before = time.monotonic() - _IDLE_S
        for who in [w for w, s in self._senders.items() if s.last_s < before]:
            self._senders.pop(who).client.close()

    def _refuse(self, text: str) -> str:
        self._refused += 1
        self._last = text
        return text
