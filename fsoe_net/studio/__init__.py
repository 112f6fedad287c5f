"""The network in a browser, based on the same library as the commands.

Add here: a route, a page, an action on the text of a network. Do not add: code that a command could
also use; put it in a lower layer, and call it from both.
"""
