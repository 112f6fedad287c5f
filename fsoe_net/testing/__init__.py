"""Doubles for the tests of programs that use fsoe-net; see docs/howto/program.md.

Add here: a double with a documented surface that our tests compare with the real program. Do not
add: helpers of our own tests (`tests`).
"""
