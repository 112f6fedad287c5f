"""Everything that is signed: the assembled report, the acceptance record and its signatures.

Add here: requirements of a sign-off, comparisons of `verify`. Anything that cannot be decided
counts as not accepted. Do not add: sections of the report (`report`), signing itself, which is the
job of ``ssh-keygen``.
"""
