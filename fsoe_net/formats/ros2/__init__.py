"""URDF and xacro of ethercat_driver_ros2."""
