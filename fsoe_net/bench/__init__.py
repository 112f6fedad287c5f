"""Measures this machine: a result as data, and its document.

Add here: a measurement that the installed tool can make. Do not add: measurements that need a
source tree, SOEM or root (`scripts/bench`), checks without a measurement (`host`).
"""
