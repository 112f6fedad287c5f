"""Test doubles for programs that use fsoe-net; see docs/howto/program.md.

Add here: a double with a documented interface that our tests compare with the real program. Do not
add: helpers of our own tests (`tests`).
"""
