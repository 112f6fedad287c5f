"""A node of ROS 2, by rclpy. Not imported by tests: a program of the Python that has rclpy.

rclpy_peer.py listen TOPIC TYPE     prints each message as JSON
rclpy_peer.py send TOPIC TYPE       publishes each line of its input, a value of ``data``
rclpy_peer.py call SERVICE          for each line of its input: whether the service is there, and
                                    whether it has answered; it waits a second for each
rclpy_peer.py set SERVICE           for each line of its input, name and value of a bool: sets it as
                                    a parameter, and prints whether that was done, and a reason
rclpy_peer.py nodes                 for each line of its input: the names of all nodes
"""

import importlib
import json
import signal
import sys

import rclpy
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

WAIT_S = 1.0


def message_type(name):
    package, _, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)


def plain(value):
    """Return a message as JSON has it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return value[0]  # `byte` of a definition
    if hasattr(value, "__iter__") and not isinstance(value, str):
        return [plain(each) for each in value]
    return value


def write(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def listen(node, topic, kind):
    node.create_subscription(message_type(kind), topic, lambda message: write(plain(message)), 10)
    while True:  # a signal is seen when it returns
        rclpy.spin_once(node, timeout_sec=WAIT_S)


def send(node, topic, kind):
    message = message_type(kind)
    publisher = node.create_publisher(message, topic, 10)
    for line in sys.stdin:
        publisher.publish(message(data=json.loads(line)))


def call(node, service):
    client = node.create_client(Trigger, service)
    for _ in sys.stdin:
        there = client.wait_for_service(timeout_sec=WAIT_S)
        reply = client.call_async(Trigger.Request()) if there else None
        if reply is not None:
            rclpy.spin_until_future_complete(node, reply, timeout_sec=WAIT_S)
        write([there, reply is not None and reply.done()])


def set_parameters(node, service):
    client = node.create_client(SetParameters, service)
    client.wait_for_service()
    for line in sys.stdin:
        name, value = json.loads(line)
        wanted = Parameter(name=name, value=ParameterValue(type=1, bool_value=value))
        reply = client.call_async(SetParameters.Request(parameters=[wanted]))
        rclpy.spin_until_future_complete(node, reply)
        write(plain(reply.result().results))


def nodes(node):
    for _ in sys.stdin:
        write(node.get_node_names())


JOBS = {"listen": listen, "send": send, "call": call, "set": set_parameters, "nodes": nodes}


def end(_number, _frame):
    sys.exit(0)


rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
signal.signal(signal.SIGTERM, end)
own = rclpy.create_node(f"peer_{sys.argv[1]}")
try:
    JOBS[sys.argv[1]](own, *sys.argv[2:])
finally:
    own.destroy_node()
    rclpy.shutdown()
