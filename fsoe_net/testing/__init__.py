"""Doubles for the tests of programs that use fsoe-net; see docs/howto/test-your-program.md."""
