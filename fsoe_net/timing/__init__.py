"""Times of a safety function: what the formulas say, what limits them, sums of PFH_D."""

from fsoe_net.timing.budget import Budget, make_budget
from fsoe_net.timing.elements import Apart, ElementRow, FunctionParts, Quantity, parts_of
from fsoe_net.timing.judgement import Judgement, WatchdogJudgement, exceeds
from fsoe_net.timing.pfh import FSOE_PFH, NOT_ASSESSED, PfhSum
from fsoe_net.timing.reaction import FunctionBudget, Reaction, with_cycle
from fsoe_net.timing.watchdogs import ConnectionBudget, Limit

__all__ = [
    "FSOE_PFH",
    "NOT_ASSESSED",
    "Apart",
    "Budget",
    "ConnectionBudget",
    "ElementRow",
    "FunctionBudget",
    "FunctionParts",
    "Judgement",
    "Limit",
    "PfhSum",
    "Quantity",
    "Reaction",
    "WatchdogJudgement",
    "exceeds",
    "make_budget",
    "parts_of",
    "with_cycle",
]
