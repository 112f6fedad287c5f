"""The network as the user's files describe it: frozen dataclasses, no I/O."""
