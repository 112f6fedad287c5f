"""YAML and JSON of fsoe-net itself, with the slave and transfer YAML that it shares with ROS 2."""
