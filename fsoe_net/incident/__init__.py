"""Incident files: the events around a failure, and its likely causes.

Add here: a piece of evidence that a file contains, a cause with its supporting facts. A cause is
decided by enums and numbers of the evidence, never by a sentence. Do not add: pages that show
incidents (`report`), or code that creates an incident file while a bus runs (`simulate`, the C
core).
"""
