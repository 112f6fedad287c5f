"""Publishes a running ``fsn-master`` as a node: diagnostics, joints, values; serves requests."""

from __future__ import annotations

import importlib
import threading
import time
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.attachment import Attachment, BusView
from fsoe_net.live.client import Client
from fsoe_net.live.control_values import Value, Values
from fsoe_net.ros2.control import NodeControl, settable
from fsoe_net.ros2.diagnostics import RosStatus, joint_status, ros_statuses
from fsoe_net.ros2.hardware import hardware_status
from fsoe_net.ros2.messages import (
    SIGNALS,
    DiagnosticArray,
    DiagnosticStatus,
    GetSdoRequest,
    GetSdoResponse,
    Header,
    JointState,
    KeyValue,
    ParameterResult,
    SetParametersRequest,
    SetParametersResponse,
    SetSdoRequest,
    SetSdoResponse,
    TriggerRequest,
    TriggerResponse,
)
from fsoe_net.ros2.names import legal_text
from fsoe_net.ros2.node import Node, header
from fsoe_net.ros2.objects import ObjectServices
from fsoe_net.ros2.recording import McapFile
from fsoe_net.ros2.values import Joint, SignalTopic, find_joints, signal_topics

if TYPE_CHECKING:
    from fsoe_net.ros2.rclpy_node import RclpyNode

LOOK_S = 0.25
"""Interval for reading the state of the bus and publishing ``/diagnostics``."""
_AGAIN_S = 1.0  # an unchanged value is published at this interval


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeOptions:
    """Options for publishing a bus.

    ``rate_hz``: rate of joints, and of values that change. ``joints``: whether to publish joints.
    ``namespace``: prefix of all topics except ``/diagnostics``, such as ``/left``. ``record``: MCAP
    file for all published messages; it is replaced. ``by_rclpy``: as a node of the installed ROS 2.
    """

    name: str
    domain: int
    here_only: bool
    rate_hz: float
    allow_control: bool
    joints: bool = True
    namespace: str = ""
    record: str | None = None
    by_rclpy: bool = False


class Bridge:
    """A node for an ``fsn-master``, across its stops and restarts; a context manager.

    Args:
        path: Control socket.
        options: Display options.

    Raises:
        EnvironmentFault: No answer, DDS does not start, or this user has no control permission.
    """

    def __init__(self, path: str, options: BridgeOptions) -> None:
        self._path, self._options = path, options
        self._ending = threading.Event()
        self._offered: tuple[tuple[str, str], ...] = ()
        self._settable: dict[str, SignalTopic] = {}
        self._readers: list[object] = []
        self._prefix = f"{options.namespace}/{options.name}"
        self._joint_topic = f"{options.namespace}/joint_states"
        self._joints: tuple[Joint, ...] = ()
        self._yields = False
        self._told = 0
        self.control: NodeControl | None = None
        self.recording: McapFile | None = None
        # A half-open bridge would keep its threads alive.
        with ExitStack() as opened:
            self._attachment = Attachment(path)
            opened.callback(self._attachment.close)
            if options.allow_control:
                self.control = NodeControl(path)
                opened.callback(self.control.close)
            if options.record is not None:
                self.recording = McapFile(options.record)
                opened.callback(self.recording.close)
            self._node = _open_node(options, self.recording)
            opened.callback(self._node.close)
            if self.control is not None:
                self._serve(self.control)
            self._opened = opened.pop_all()
        # Values have a separate thread: diagnostics must appear even if no value arrives.
        self._values = threading.Thread(target=self._follow_values, name="values", daemon=True)
        self._values.start()

    @property
    def topics(self) -> tuple[str, ...]:
        """Published topics; the last one is the prefix of values and services."""
        joints = (self._joint_topic,) if self._options.joints else ()
        return ("/diagnostics", *joints, self._prefix)

    @property
    def maker(self) -> str:
        """What makes the node: an implementation of DDS, or an installation of ROS 2."""
        return self._node.maker

    def left_out(self) -> list[tuple[str, str]]:
        """Return what was left out since the last call, and what ROS has instead of its type."""
        rows = list(self._node.missing.items())[self._told :]
        self._told += len(rows)
        return rows

    def __enter__(self) -> Bridge:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the domain; ``fsn-master`` continues, outputs of nodes take their stop values."""
        self._ending.set()
        self._values.join()
        self._opened.close()

    def _serve(self, control: NodeControl) -> None:
        for word in ("start", "stop", "restart"):
            self._node.serve(
                f"{self._prefix}/{word}",
                (TriggerRequest, TriggerResponse),
                control.bus_request(word),
            )
        self._node.serve(
            f"{self._prefix}/set_parameters",
            (SetParametersRequest, SetParametersResponse),
            self._set_parameters,
        )
        objects = ObjectServices(self._path)
        for name, types, answer in (
            ("get_sdo", (GetSdoRequest, GetSdoResponse), objects.get_sdo),
            ("set_sdo", (SetSdoRequest, SetSdoResponse), objects.set_sdo),
        ):
            self._node.serve(f"{self._prefix}/{name}", types, answer, is_slow=True)

    def look(self, stop: threading.Event | None = None) -> BusView:
        """Wait for a moment, then publish the state of the bus and return it.

        Raises:
            EnvironmentFault: The recording cannot be continued.
        """
        if self.recording is not None:
            self.recording.check()
        view = self._attachment.look(LOOK_S, stop)
        # Events are not shown here; keeping them would exhaust the memory.
        self._attachment.take_events()
        found = ros_statuses(view)
        # With two publishers of one joint, its state would jump between them.
        self._yields = self._node.has_other_publisher(self._joint_topic)
        if self._joints and self._options.joints:
            found.append(joint_status(self._joints, self._joint_topic, yields=self._yields))
        if self.control is not None:
            waiting = self._node.offer_services()
            node = self._node
            found.append(
                self.control.status(node.answers, node.unreadable, node.unanswered, waiting)
            )
        now = header()
        hardware = self._path if view.status is None else view.status.interface or self._path
        self._node.publish("/diagnostics", self._array(found, now, hardware))
        self._node.publish(f"{self._prefix}/hardware_status", hardware_status(view, now, hardware))
        return view

    def _array(self, found: Iterable[RosStatus], now: Header, hardware: str) -> DiagnosticArray:
        return DiagnosticArray(
            header=now,
            status=[
                DiagnosticStatus(
                    level=int(row.level),
                    name=legal_text(f"{self._options.name}: {row.name}"),
                    message=legal_text(row.message),
                    hardware_id=legal_text(hardware),
                    values=[KeyValue(legal_text(k), legal_text(v)) for k, v in row.values],
                )
                for row in found
            ],
        )

    # -- values have a separate connection and their own rate ---------------------------------

    def _follow_values(self) -> None:
        while not self._ending.is_set():
            try:
                with Client(self._path) as client:
                    self._follow(client)
            except EnvironmentFault:  # reported by the state of the bus
                self._joints = ()
                self._ending.wait(_AGAIN_S)

    def _follow(self, client: Client) -> None:
        """Publish values until the bus stops or ``fsn-master`` ends; it may return with others."""
        symbols = client.symbols()
        topics, joints = signal_topics(symbols), find_joints(symbols)
        self._joints = joints
        self._offer(settable(topics, joints) if self.control is not None else ())
        if not topics:
            self._ending.wait(_AGAIN_S)
            return
        cycle_ns = client.status().cycle_ns or 1_000_000
        # DDS cannot carry each cycle of a fast bus; the user sets the rate.
        every = max(1, round(1e9 / (self._options.rate_hz * cycle_ns)))
        client.watch_on("*", every=min(every, 1_000_000), typed=True)
        shown = _Shown()
        silent_since = time.monotonic()
        while not self._ending.is_set():
            rows = client.watched(LOOK_S)
            if rows:
                silent_since = time.monotonic()
                # Only the newest row: a delayed node must not publish outdated values.
                self._publish(rows[-1], topics, joints, shown)
            # A silent bus may have another plan when it returns: topics are created again.
            elif time.monotonic() - silent_since > _AGAIN_S:
                self._joints = ()
                return

    def _publish(
        self,
        values: Values,
        topics: tuple[SignalTopic, ...],
        joints: tuple[Joint, ...],
        shown: _Shown,
    ) -> None:
        # ROS expects joint positions in radians or metres (REP 103); raw counts would mislead.
        joints = tuple(joint for joint in joints if not joint.is_raw)
        if joints and self._options.joints and not self._yields:
            rows = [joint.values(values.inputs) for joint in joints]
            position, velocity, effort = (list(column) for column in zip(*rows, strict=True))
            names = [joint.name for joint in joints]
            state = JointState(header(), names, position, velocity, effort)
            self._node.publish(self._joint_topic, state)
        for topic, raw in shown.due(topics, values):
            value = topic.kind.python(raw)
            self._node.publish(f"{self._prefix}/{topic.topic}", SIGNALS[topic.kind](value))

    def _offer(self, topics: tuple[SignalTopic, ...]) -> None:
        """Subscribe to the current settable outputs; another plan has other outputs."""
        offered = tuple((t.topic, t.symbol.name) for t in topics)
        if self.control is None or offered == self._offered:
            return
        # Unsubscribe first: an output of the old plan must no longer be set.
        for reader in self._readers:
            self._node.unsubscribe(reader)
        self._readers = [
            self._node.subscribe(
                f"{self._prefix}/{topic.topic}/set",
                SIGNALS[topic.kind],
                partial(self.control.set_output, topic),
            )
            for topic in topics
        ]
        self._settable = {t.symbol.name: t for t in topics}
        self._offered = offered

    def _set_parameters(self, request: Any, who: str) -> tuple[list[ParameterResult]]:
        assert self.control is not None  # noqa: S101 - it is served only then
        results = self.control.set_parameters(self._settable, request, who)
        return ([ParameterResult(done, legal_text(text)) for done, text in results],)


def has_rclpy() -> bool:
    """Return whether ROS 2 is installed for this Python and its environment was set up."""
    try:
        importlib.import_module("rclpy")
    except ImportError:  # absent, or of another Python
        return False
    return True


def _open_node(options: BridgeOptions, recording: McapFile | None) -> Node | RclpyNode:
    if not options.by_rclpy:
        return Node(options.domain, here_only=options.here_only, recording=recording)
    from fsoe_net.ros2.rclpy_node import RclpyNode

    return RclpyNode(
        options.name,
        namespace=options.namespace,
        domain=options.domain,
        here_only=options.here_only,
        recording=recording,
    )


class _Shown:
    """The published values, and when all of them were last published."""

    def __init__(self) -> None:
        self._last: dict[str, Value] = {}  # by topic
        self._all_s = -_AGAIN_S

    def due(
        self, topics: tuple[SignalTopic, ...], values: Values
    ) -> list[tuple[SignalTopic, Value]]:
        """Return topics with changed values; at an interval, return all of them."""
        now_s = time.monotonic()
        # Also without a change, for subscribers that connect later.
        every = now_s - self._all_s >= _AGAIN_S
        if every:
            self._all_s = now_s
        sides = ((t, values.side(t.symbol.is_output)) for t in topics)
        present = [(t, side[t.symbol.name]) for t, side in sides if t.symbol.name in side]
        last, self._last = self._last, {t.topic: value for t, value in present}
        return [(t, v) for t, v in present if every or last.get(t.topic) != v]
