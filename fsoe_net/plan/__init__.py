"""Compile a network to a copy plan; write, read and show `.fsnplan` files."""

from fsoe_net.plan.accepted import accepted_plan
from fsoe_net.plan.codec import MAGIC, decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import (
    FORM,
    SECTIONS,
    Fingerprint,
    canonical_section,
    cycle_sha256,
    fingerprint_from_json,
    fingerprint_of,
    fingerprint_of_sections,
    safety_sha256,
    safety_text,
    short_code,
)
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
    "FORM",
    "MAGIC",
    "NONE",
    "SECTIONS",
    "Fingerprint",
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
    "accepted_plan",
    "canonical_section",
    "compile_plan",
    "copy_end",
    "cycle_sha256",
    "decode_plan",
    "encode_plan",
    "entry_at",
    "fingerprint_from_json",
    "fingerprint_of",
    "fingerprint_of_sections",
    "igh_image",
    "igh_text",
    "plan_json",
    "plan_text",
    "safety_sha256",
    "safety_text",
    "short_code",
]
