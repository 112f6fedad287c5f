"""What `slaveinfo -map` of SOEM prints."""
