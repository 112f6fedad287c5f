"""ENI, EtherCAT network information: read, written, and its copies replaced."""
