"""A node of an installed ROS 2, by ``rclpy``: in the node list, on every rmw, with all callers.

Messages are those of `messages`: ``rclpy`` publishes and receives them as bytes. Of a service it
converts between bytes and its own classes; there a request has no caller in front.
"""

from __future__ import annotations

import importlib
import os
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from cyclonedds.idl import IdlStruct
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions

from fsoe_net.errors import EnvironmentFault
from fsoe_net.ros2.messages import HASHES
from fsoe_net.ros2.node import Received
from fsoe_net.ros2.recording import McapFile

_DEPTH = 10
_HEAD = 4  # bytes of the encapsulation, in front of each message
_CALLER = 16  # bytes of ``client`` and ``number`` in requests and replies
_NODE = "a node"  # rclpy does not tell which


class RclpyNode:
    """Publishers, subscriptions and services of one node; must be closed.

    Args:
        name: Name of the node.
        namespace: Its namespace, such as ``/left``, or empty.
        domain: Domain ID, 0 to 232.
        here_only: No other machine can receive or send.
        recording: Receives all published messages.

    Raises:
        EnvironmentFault: ROS 2 does not start.
    """

    maker = f"rclpy of {os.environ.get('ROS_DISTRO', 'ROS 2')}"
    answers = "all callers"

    def __init__(
        self,
        name: str,
        *,
        namespace: str,
        domain: int,
        here_only: bool,
        recording: McapFile | None = None,
    ) -> None:
        self.unsent = self.unreadable = self.unanswered = 0
        self.missing: dict[str, str] = {}
        """Topics and services that are left out, and what ROS has instead of their type."""
        self._recording = recording
        self._publishers: dict[str, Any] = {}
        self._lock = threading.Lock()
        if here_only:  # read when a context is made
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self._context = rclpy.Context()
        try:
            rclpy.init(
                args=[],
                context=self._context,
                domain_id=domain,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            # Outputs are set by a `set_parameters` of ours, each for a second.
            self._node = rclpy.create_node(
                name, namespace=namespace, context=self._context, start_parameter_services=False
            )
        except Exception as exc:  # rclpy has no common class of errors
            raise EnvironmentFault(f"ROS 2 does not start: {exc}") from exc
        # One thread for messages, one for slow services.
        self._executor = MultiThreadedExecutor(2, context=self._context)
        self._executor.add_node(self._node)
        self._slow = MutuallyExclusiveCallbackGroup()
        self._thread = threading.Thread(target=self._executor.spin, name="ros", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def publish(self, topic: str, message: IdlStruct) -> None:
        """Publish a message, if its type is installed; always the same type for a topic."""
        with self._lock:
            if topic not in self._publishers:
                self._publishers[topic] = self._publisher(topic, type(message))
            payload = message.serialize(use_version_2=False)
            publisher = self._publishers[topic]
            if publisher is not None:
                publisher.publish(payload)
            if self._recording is not None:
                self._recording.add(topic, message, payload, time.time_ns())

    def has_other_publisher(self, topic: str) -> bool:
        """Return whether another node currently publishes a topic."""
        ours = (self._node.get_name(), self._node.get_namespace())
        rows = self._node.get_publishers_info_by_topic(topic)
        return any((row.node_name, row.node_namespace) != ours for row in rows)

    def subscribe(self, topic: str, message: type[IdlStruct], received: Received) -> object:
        """Handle messages as they arrive; of a fast sender, only the newest one."""
        kind = self._type(topic, message)
        if kind is None:
            return None

        def handle(payload: bytes) -> None:
            try:
                read = message.deserialize(payload)
            except Exception:  # arbitrary bytes of the network
                self.unreadable += 1
                return
            received(read, _NODE)

        return self._node.create_subscription(kind, topic, handle, 1, raw=True)

    def unsubscribe(self, reader: object) -> None:
        """Unsubscribe."""
        if reader is not None:
            self._node.destroy_subscription(reader)

    def serve(
        self,
        name: str,
        types: tuple[type[IdlStruct], type[IdlStruct]],
        answer: Callable[[Any, str], tuple[Any, ...]],
        *,
        is_slow: bool = False,
    ) -> None:
        """Serve requests of all callers, if the type of the service is installed.

        Args:
            name: Name of the service, with its slash.
            types: Types of a request and of its reply.
            answer: Executes a request and returns the fields of the reply.
            is_slow: Whether it may take seconds; other messages are handled meanwhile.
        """
        asking, answering = types
        kind = self._type(name, asking)
        if kind is None:
            return

        def handle(request: Any, _response: Any) -> Any:
            payload = serialize_message(request)
            read = asking.deserialize(payload[:_HEAD] + bytes(_CALLER) + payload[_HEAD:])
            reply = answering(0, 0, *answer(read, _NODE)).serialize(use_version_2=False)
            return deserialize_message(reply[:_HEAD] + reply[_HEAD + _CALLER :], kind.Response)

        group = self._slow if is_slow else None
        self._node.create_service(kind, name, handle, callback_group=group)

    def offer_services(self) -> tuple[str, ...]:
        """Return the services that have callers which cannot be answered: none."""
        return ()

    def _publisher(self, topic: str, message: type[IdlStruct]) -> Any:
        kind = self._type(topic, message)
        if kind is None:
            return None
        publisher = self._node.create_publisher(kind, topic, _DEPTH)
        for row in self._node.get_publishers_info_by_topic(topic):
            if row.node_name != self._node.get_name():
                continue
            if bytes(row.topic_type_hash.value) != bytes.fromhex(HASHES[message]):
                # Of another version: whoever reads its bytes would read something else.
                self.missing[topic] = f"another version of {row.topic_type}"
                self._node.destroy_publisher(publisher)
                return None
        return publisher

    def _type(self, name: str, message: type[IdlStruct]) -> Any:
        """Return the class of ROS for a message or, from its request, a service."""
        package, part, _, kind = message.__idl_typename__.split("::")
        kind = kind.removesuffix("_").removesuffix("_Request")
        try:
            return getattr(importlib.import_module(f"{package}.{part}"), kind)
        except (ImportError, AttributeError):
            self.missing[name] = f"no {package}/{part}/{kind}"
            return None
