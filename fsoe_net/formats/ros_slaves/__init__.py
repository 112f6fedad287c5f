"""The older ``ethercat_slaves.yaml`` of IgH nodes for ROS."""
