"""Compile a network to a copy plan; write, read and show `.fsnplan` files."""
