"""Starts ros2_control with a description that `fsoe-net convert` has written."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import Command, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def require_description(context):
    """End here if there is no such file: the traceback of xacro does not end with this reason."""
    path = LaunchConfiguration("description").perform(context)
    if not Path(path).is_file():
        raise RuntimeError(f"{path} is not a file; `fsoe-net convert` writes it from a network")


def generate_launch_description():
    """Return the controller manager, the state publisher and one broadcaster."""
    own = FindPackageShare("fsoe_net_ros")
    description, socket = LaunchConfiguration("description"), LaunchConfiguration("socket")
    words = ["xacro ", description, " socket:=", socket]
    robot = {"robot_description": ParameterValue(Command(words), value_type=str)}
    controllers = LaunchConfiguration("controllers")
    # Without this, the controller manager of Jazzy ends when fsn-master does not run yet.
    waits = {"hardware_components_initial_state.shutdown_on_initial_state_failure": False}
    return LaunchDescription(
        [
            DeclareLaunchArgument("description", description="ros2_control.urdf.xacro"),
            DeclareLaunchArgument(
                "socket",
                default_value="/run/fsn-master/fsn-master-eth1.sock",
                description="control socket of fsn-master",
            ),
            DeclareLaunchArgument(
                "controllers",
                default_value=PathJoinSubstitution([own, "config", "controllers.yaml"]),
            ),
            DeclareLaunchArgument(
                "rviz",
                default_value="false",
                description="true: starts rviz2, which must be installed",
            ),
            OpaqueFunction(function=require_description),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[robot],
            ),
            Node(
                package="controller_manager",
                executable="ros2_control_node",
                parameters=[robot, controllers, waits],
                output="both",
            ),
            Node(
                package="controller_manager",
                executable="spawner",
                # Since ros2_control 6, a controller does not have the parameters of its manager.
                arguments=["joint_state_broadcaster", "--param-file", controllers],
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", PathJoinSubstitution([own, "config", "cell.rviz"])],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
