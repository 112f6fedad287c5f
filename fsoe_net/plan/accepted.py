"""The plan in an acceptance record."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import FindingList
from fsoe_net.errors import PlanFormatError
from fsoe_net.model.acceptance import Acceptance
from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.fingerprint import SECTIONS, Fingerprint, fingerprint_of, safety_sha256
from fsoe_net.plan.model import Plan


def accepted_plan(record: Acceptance, out: FindingList) -> tuple[Plan, Fingerprint] | None:
    """Return the plan in a record, and its fingerprint calculated from the plan.

    Args:
        record: The record.
        out: Takes FSN162 if the record is inconsistent: an invalid plan, safety functions that are
            not those of the plan, or a fingerprint that differs from the stated one.
    """
    fix = "take the record from version control, or make it again"
    try:
        plan = decode_plan(record.plan)
    except PlanFormatError as exc:
        out.add("FSN162", record.at("plan"), f"the plan in this record: {exc}", hint=fix)
        return None
    # Safety functions are not in the plan records; only their hash links them to it.
    if plan.safety_sha256 != safety_sha256(record.safety_functions):
        place = record.at("safety_functions")
        text = "the safety functions in this record are not those of its plan"
        out.add("FSN162", place, text, hint=fix)
        return None
    found = fingerprint_of(plan)
    # Compared section by section, so that the message names the differing ones.
    stated = {name: record.sections.get(name) for name in SECTIONS}
    wrong = [name for name in SECTIONS if stated[name] != found.sections[name]]
    if wrong or record.whole != found.whole:
        where = f"section {', '.join(wrong)}" if wrong else "the whole"
        text = f"the fingerprint in this record is not that of its plan: {where}"
        out.add("FSN162", record.at("sections" if wrong else "fingerprint"), text, hint=fix)
        return None
    return plan, found
