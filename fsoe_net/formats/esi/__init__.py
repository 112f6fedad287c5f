"""ESI, EtherCAT SubDevice information: the device description of a vendor."""
