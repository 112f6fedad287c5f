"""Checks the machine for anything that disturbs a real-time cycle; changes nothing itself.

Add here: a finding about kernel, processors, interface or permissions, read through `seam.py`. Do
not add: advice without a measured fact, or anything that changes the machine.
"""
