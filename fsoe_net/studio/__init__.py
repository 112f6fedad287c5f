"""The network in a browser: the same library behind it as behind the commands.

Add here: a route, a page, an action on the text of a network. Do not add: what a command could need
too; it belongs below, and both call it.
"""
