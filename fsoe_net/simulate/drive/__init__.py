"""Emulated drives by CiA 402: state machine, motion, safety functions, motor; time is given."""
