"""Live sessions: emulated devices, the C core and a scenario, in virtual or real time."""
