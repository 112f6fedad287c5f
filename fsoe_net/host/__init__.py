"""Looks at the machine for what disturbs a real-time cycle; changes nothing."""

from fsoe_net.host.doctor import Examination, examine
from fsoe_net.host.ethtool import driver as network_driver
from fsoe_net.host.finding import Finding, Level
from fsoe_net.host.seam import Host, RealSeam, Seam, Unreadable

__all__ = [
    "Examination",
    "Finding",
    "Host",
    "Level",
    "RealSeam",
    "Seam",
    "Unreadable",
    "examine",
    "network_driver",
]
