"""A node that drives a controller_manager. Not imported by tests: a program of the Python of ROS.

Each line of its input is a JSON array, the name of a function below and its arguments; each is
answered by one line. Joint states are received all the time.
"""

import json
import sys
import threading

import rclpy
from builtin_interfaces.msg import Duration
from controller_manager_msgs.srv import (
    ConfigureController,
    ListControllers,
    ListHardwareComponents,
    LoadController,
    SetHardwareComponentState,
    SwitchController,
)
from lifecycle_msgs.msg import State
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

SERVICES = {
    "load_controller": LoadController,
    "configure_controller": ConfigureController,
    "switch_controller": SwitchController,
    "list_controllers": ListControllers,
    "list_hardware_components": ListHardwareComponents,
    "set_hardware_component_state": SetHardwareComponentState,
}


class Peer:
    def __init__(self):
        self.node = rclpy.create_node("fsn_peer")
        self.clients = {
            name: self.node.create_client(kind, f"/controller_manager/{name}")
            for name, kind in SERVICES.items()
        }
        self.publishers = {}
        self.received = threading.Condition()
        self.count, self.newest, self.newest_s, self.gap_s = 0, {}, None, 0.0
        self.node.create_subscription(JointState, "/joint_states", self.receive, 10)
        threading.Thread(target=rclpy.spin, args=[self.node], daemon=True).start()

    def receive(self, message):
        at_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        rows = zip(message.name, message.position, message.velocity, strict=True)
        with self.received:
            if self.newest_s is not None:
                self.gap_s = max(self.gap_s, at_s - self.newest_s)
            self.newest_s = at_s
            self.newest = {name: [position, velocity] for name, position, velocity in rows}
            self.count += 1
            self.received.notify_all()

    def call(self, name, /, **fields):
        client = self.clients[name]
        assert client.wait_for_service(timeout_sec=60.0), name
        done = threading.Event()
        future = client.call_async(SERVICES[name].Request(**fields))
        future.add_done_callback(lambda _: done.set())
        done.wait()
        return future.result()

    def publish(self, topic, message):
        while not self.publishers[topic].get_subscription_count():
            pass
        self.publishers[topic].publish(message)

    def describe(self, text):
        """Publish a robot description, as robot_state_publisher does."""
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.description = self.node.create_publisher(String, "/robot_description", qos)
        self.description.publish(String(data=text))

    def load(self, name):
        """Load and configure a controller, long before it is commanded: DDS must find it."""
        for kind, topic in ((Float64MultiArray, "commands"), (JointTrajectory, "joint_trajectory")):
            topic = f"/{name}/{topic}"
            self.publishers[topic] = self.node.create_publisher(kind, topic, 10)
        loaded = self.call("load_controller", name=name).ok
        return loaded and self.call("configure_controller", name=name).ok

    def switch(self, started, stopped):
        strict = SwitchController.Request.STRICT
        names = {"activate_controllers": started, "deactivate_controllers": stopped}
        timeout = Duration(sec=5)
        return self.call("switch_controller", strictness=strict, timeout=timeout, **names).ok

    def hardware(self, name, label):
        """Move a component to a state, such as ``active``; whether it has reached it."""
        states = {"active": State.PRIMARY_STATE_ACTIVE, "inactive": State.PRIMARY_STATE_INACTIVE}
        states["unconfigured"] = State.PRIMARY_STATE_UNCONFIGURED
        target = State(id=states[label], label=label)
        return self.call("set_hardware_component_state", name=name, target_state=target).ok

    def states(self):
        """Return the state of each component and controller."""
        rows = self.call("list_hardware_components").component
        states = {row.name: row.state.label for row in rows}
        rows = self.call("list_controllers").controller
        return states | {row.name: row.state for row in rows}

    def joints(self):
        """Wait for the next joint states: a position and a velocity for each name."""
        with self.received:
            count = self.count
            self.received.wait_for(lambda: self.count > count)
            return self.newest

    def gap(self):
        """Return the longest time between two joint states since this was last asked."""
        with self.received:
            gap_s, self.gap_s = self.gap_s, 0.0
        return gap_s

    def command(self, controller, *values):
        message = Float64MultiArray(data=values)
        self.publish(f"/{controller}/commands", message)
        return True

    def trajectory(self, controller, joint, *points):
        """Send points, each a position and when it is to be reached."""
        rows = []
        for position, at_s in points:
            after = Duration(sec=int(at_s), nanosec=int(at_s % 1 * 1e9))
            rows.append(JointTrajectoryPoint(positions=[position], time_from_start=after))
        message = JointTrajectory(joint_names=[joint], points=rows)
        self.publish(f"/{controller}/joint_trajectory", message)
        return True


rclpy.init()
peer = Peer()
for line in sys.stdin:
    name, *arguments = json.loads(line)
    sys.stdout.write(json.dumps(getattr(peer, name)(*arguments)) + "\n")
    sys.stdout.flush()
