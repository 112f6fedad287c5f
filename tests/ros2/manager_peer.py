"""A node that drives a controller_manager. Not imported by tests: a program of the Python of ROS.

Each line of its input is a JSON array, the name of a function below and its arguments; each is
answered by one line. Joint states are received all the time.
"""

import json
import sys
import threading

import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from controller_manager_msgs.srv import (
    ConfigureController,
    ListControllers,
    ListHardwareComponents,
    LoadController,
    SetHardwareComponentState,
    SwitchController,
)
from lifecycle_msgs.msg import State
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from tf2_msgs.msg import TFMessage
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
        self.commands, self.actions, self.results = {}, {}, {}
        self.received = threading.Condition()
        self.count, self.newest, self.newest_s, self.gap_s = 0, {}, None, 0.0
        self.transforms = set()
        self.node.create_subscription(JointState, "/joint_states", self.receive, 10)
        self.node.create_subscription(TFMessage, "/tf", self.transform, 10)
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

    def transform(self, message):
        rows = [(row.header.frame_id, row.child_frame_id) for row in message.transforms]
        self.transforms.update(rows)

    def call(self, name, /, **fields):
        client = self.clients[name]
        assert client.wait_for_service(timeout_sec=60.0), name
        return self.result_of(client.call_async(SERVICES[name].Request(**fields)))

    def result_of(self, future, longest_s=None):
        """Wait for a result; none: it has not come in this time."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        return future.result() if done.wait(longest_s) else None

    def publish(self, topic, message):
        while not self.commands[topic].get_subscription_count():
            pass
        self.commands[topic].publish(message)

    def describe(self, text):
        """Publish a robot description, as robot_state_publisher does."""
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.description = self.node.create_publisher(String, "/robot_description", qos)
        self.description.publish(String(data=text))

    def load(self, name):
        """Load and configure a controller, long before it is commanded: DDS must find it."""
        topic, action = f"/{name}/commands", f"/{name}/follow_joint_trajectory"
        self.commands[topic] = self.node.create_publisher(Float64MultiArray, topic, 10)
        self.actions[name] = ActionClient(self.node, FollowJointTrajectory, action)
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
        reply = self.call("set_hardware_component_state", name=name, target_state=target)
        return reply.ok and reply.state.label == label  # in Humble `ok` alone says less

    def states(self):
        """Return the state of each component and controller."""
        rows = self.call("list_hardware_components").component
        states = {row.name: row.state.label for row in rows}
        rows = self.call("list_controllers").controller
        return states | {row.name: row.state for row in rows}

    def joints(self):
        """Wait for the next joint states: their time, position and velocity for each name."""
        with self.received:
            count = self.count
            self.received.wait_for(lambda: self.count > count)
            return self.newest_s, self.newest

    def gap(self):
        """Return the longest time between two joint states since this was last asked."""
        with self.received:
            gap_s, self.gap_s = self.gap_s, 0.0
        return gap_s

    def frames(self):
        """Return the transforms received so far, each as a frame and its child."""
        return sorted(self.transforms)

    def publishers(self):
        """Return each topic that somebody publishes, and whether late subscribers get its last."""
        names = [name for name, _ in self.node.get_topic_names_and_types()]
        rows = {name: self.node.get_publishers_info_by_topic(name) for name in names}
        last = DurabilityPolicy.TRANSIENT_LOCAL
        return {n: rows[n][0].qos_profile.durability == last for n in names if rows[n]}

    def command(self, controller, *values):
        message = Float64MultiArray(data=values)
        self.publish(f"/{controller}/commands", message)
        return True

    def follow(self, controller, joints, *points):
        """Send a goal, and return whether it is accepted: for each point the time when it is to be
        reached, positions, and none or all velocities and accelerations. A busy installation has
        lost goals."""
        rows = []
        for at_s, *numbers in points:
            after = Duration(sec=int(at_s), nanosec=int(at_s % 1 * 1e9))
            fields = zip(("positions", "velocities", "accelerations"), numbers, strict=False)
            rows.append(JointTrajectoryPoint(time_from_start=after, **dict(fields)))
        trajectory = JointTrajectory(joint_names=joints, points=rows)
        client = self.actions[controller]
        assert client.wait_for_server(timeout_sec=60.0), controller
        goal = FollowJointTrajectory.Goal(trajectory=trajectory)
        handle = self.result_of(client.send_goal_async(goal), 10.0)
        if handle is None or not handle.accepted:
            return False
        self.results[controller] = handle.get_result_async()
        return True

    def outcome(self, controller):
        """Wait for the end of the last goal; return its status and error code, if they come."""
        done = self.result_of(self.results.pop(controller), 60.0)
        return done and [done.status, done.result.error_code]


rclpy.init()
peer = Peer()
for line in sys.stdin:
    name, *arguments = json.loads(line)
    sys.stdout.write(json.dumps(getattr(peer, name)(*arguments)) + "\n")
    sys.stdout.flush()
