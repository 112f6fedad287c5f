"""A running ``fsn-master`` as a node of ROS 2, over DDS, without an installation of ROS.

Add here: a message, a service, a parameter of the node. Only this package imports `cyclonedds`. Do
not add: decisions about the health of a bus (`live/health.py`).
"""
