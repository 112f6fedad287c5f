"""The intervention log: entries chained by hashes; reading, checking and selecting them.

Add here: a kind of entry, a check of the chain. The writer is ``fsn-master`` in C (`app/log`). Do
not add: permissions (the control socket decides who may intervene).
"""
