"""The log of interventions: entries chained by hashes, read, checked and selected.

Add here: a kind of entry, a check of the chain. The writer is ``fsn-master`` in C (`app/log`). Do
not add: who may intervene (the control socket decides).
"""
