"""A running ``fsn-master`` as a node of ROS 2, over DDS, without an installation of ROS."""
