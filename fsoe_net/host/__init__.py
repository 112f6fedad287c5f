"""Looks at the machine for what disturbs a real-time cycle; changes nothing.

Add here: a finding about kernel, processors, interface or permissions, read through `seam.py`. Do
not add: advice that no reading supports, or anything that changes the machine.
"""
