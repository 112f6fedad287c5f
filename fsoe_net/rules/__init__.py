"""The rules: what is wrong in a network, as diagnostics. One module per family."""
