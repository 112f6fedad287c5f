"""Measures this machine: a result as data, and its document.

Measurements that need a source tree, SOEM or root stay in `scripts/bench`.
"""
