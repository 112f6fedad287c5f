"""What the `ethercat` tool of IgH prints, and C headers for its library or any other."""
