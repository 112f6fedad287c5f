"""What the commands do, without a terminal: load, check, compare, propose, convert, simulate."""
