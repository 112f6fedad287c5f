"""Faults between two ends, seeded and judged: channel, injectors, campaigns, shrinking.

channel         two ends, held images, time, injectors on the way
faults          injectors; composable
injection       one case, and short ways to draw one
fault_classes   what IEC 61784-3 names, and what a relay can do wrong, as draws of injectors
beyond_crc      draws of cases that no CRC hides
bit_errors      every bit error of few bits, by number
clean_run       clean runs, and points in them to inject at
departure       what is due by a state table, and where an end does otherwise
tables          what the state tables ask of an end, followed from its frames
faulty_main     a main that says what a sub must refuse
judge, collision_proof
                what became of a fault; the proof that an acceptance was a CRC collision
trials          many faults of one class; statistics
shrink          a failing case made small
recorder        a run as a recording

Add here: a class of faults with its source, a judge of what became of one. Do not add: the state
machines (`fsoe`), campaigns over a whole network (`simulate/campaign.py`).
"""
