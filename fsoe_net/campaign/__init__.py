"""Faults between two ends, seeded and judged: channel, injectors, campaigns, shrinking.

channel         two ends, held images, time, injectors on the path
faults          injectors, which can be combined
injection       one case, and short ways to draw one
fault_classes   communication errors of IEC 61784-3 and relay errors, drawn as injectors
beyond_crc      cases that no CRC detects
bit_errors      all errors of a few bits, numbered
clean_run       clean runs, and points in them where faults can be injected
departure       the action required by a state table, and deviations of an end
tables          requirements of the state tables on an end, followed from its frames
faulty_main     a main that sends what a sub must refuse
judge, collision_proof
                outcome of a fault; the proof that an acceptance was a CRC collision
trials          many faults of one class; statistics
shrink          a failing case minimised
recorder        a run as a recording

Add here: a class of faults with its source, a judge of outcomes. Do not add: the state machines
(`fsoe`), campaigns over a whole network (`simulate/campaign.py`).
"""
