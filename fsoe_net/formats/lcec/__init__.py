"""XML of linuxcnc-ethercat, read and written."""
