"""What is signed: the report as it is put together, the record of an acceptance, signatures.

Add here: what a sign-off asks for, what `verify` compares. Anything that cannot be decided counts
as not accepted. Do not add: sections of the report (`report`), signing itself: ``ssh-keygen`` does
it.
"""
