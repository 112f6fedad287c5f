"""The network in a browser: the same library behind it as behind the commands."""
