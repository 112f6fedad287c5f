"""Console of a running ``fsn-master``: its language, its commands, its connection.

Add here: a command with its help and completion. Do not add: requests and their replies
(`live.client`), the terminal (`cli`).
"""
