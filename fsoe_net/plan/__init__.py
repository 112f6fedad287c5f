"""Compile a network to a copy plan; write, read and show `.fsnplan` files."""

from fsoe_net.plan.codec import MAGIC, decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.image import IghDatagram, IghDomain, IghFmmu, igh_image, igh_text
from fsoe_net.plan.model import (
    NONE,
    Plan,
    PlanBlock,
    PlanConnection,
    PlanCopy,
    PlanEntry,
    PlanPdo,
    PlanSdo,
    PlanSubDevice,
    PlanSymbol,
    PlanSyncManager,
)
from fsoe_net.plan.show import copy_end, entry_at, plan_json, plan_text

__all__ = [
    "MAGIC",
    "NONE",
    "IghDatagram",
    "IghDomain",
    "IghFmmu",
    "Plan",
    "PlanBlock",
    "PlanConnection",
    "PlanCopy",
    "PlanEntry",
    "PlanPdo",
    "PlanSdo",
    "PlanSubDevice",
    "PlanSymbol",
    "PlanSyncManager",
    "compile_plan",
    "copy_end",
    "decode_plan",
    "encode_plan",
    "entry_at",
    "igh_image",
    "igh_text",
    "plan_json",
    "plan_text",
]
