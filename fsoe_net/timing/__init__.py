"""Times of a safety function: what the formulas say, what limits them."""

from fsoe_net.timing.formulas import (
    RESERVE,
    PartTimes,
    beckhoff_typical,
    beckhoff_worst_case,
    error_free,
    lost_frames_survived,
    round_trip_input,
    round_trip_output,
    watchdog_input,
    watchdog_output,
    worst_case_input,
    worst_case_output,
)

__all__ = [
    "RESERVE",
    "PartTimes",
    "beckhoff_typical",
    "beckhoff_worst_case",
    "error_free",
    "lost_frames_survived",
    "round_trip_input",
    "round_trip_output",
    "watchdog_input",
    "watchdog_output",
    "worst_case_input",
    "worst_case_output",
]
