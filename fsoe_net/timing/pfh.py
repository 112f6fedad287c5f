"""Sums of PFH: vendor values are added up, never calculated here.

PFH is the average frequency of a dangerous failure per hour, the term of ISO 13849-1:2023 and IEC
62061:2021; older data sheets call it PFH_D or PFHd.

The residual error of FSoE itself belongs to ETG and its certifier; Beckhoff's application guide
charges 1.00E-09 per hour for Safety over EtherCAT, once per safety function.
"""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.timing.elements import FunctionParts
from fsoe_net.timing.judgement import Judgement

FSOE_PFH = 1.0e-9  # Beckhoff, Application Guide TwinSAFE, row "Safety over EtherCAT"
NOT_ASSESSED = "category, diagnostic coverage and common causes not assessed"

# Upper bounds per hour: ISO 13849-1 table 2 and IEC 62061 table 3 for high demand.
_PL = {"a": 1e-4, "b": 1e-5, "c": 3e-6, "d": 1e-6, "e": 1e-7}
_SIL = {1: 1e-5, 2: 1e-6, 3: 1e-7}


@dataclass(frozen=True, slots=True, kw_only=True)
class PfhSum:
    """Sum of the dangerous failures per hour of a safety function.

    Attributes:
        total: Sum of the known values, including FSoE, per hour.
        fsoe: Share of FSoE, per hour; 0 if no connection is used.
        limit: Upper bound of the required level, per hour; ``None`` if none is required.
        missing: Elements without a value.
        unverified: Elements with an unverified value.
    """

    total: float
    fsoe: float
    limit: float | None
    missing: tuple[str, ...]
    unverified: tuple[str, ...]

    @property
    def pl(self) -> str:
        """Highest performance level whose limit the sum does not exceed; may be empty."""
        return max((pl for pl, bound in _PL.items() if self.total < bound), default="")

    @property
    def sil(self) -> int:
        """Highest safety integrity level whose limit the sum does not exceed; 0 if none."""
        return max((sil for sil, bound in _SIL.items() if self.total < bound), default=0)

    @property
    def judgement(self) -> Judgement:
        """The sum compared with the limit; missing values can only increase it."""
        if self.limit is None:
            return Judgement.NONE
        if self.total >= self.limit:
            return Judgement.ABOVE
        if self.missing:
            return Judgement.MISSING
        return Judgement.UNVERIFIED if self.unverified else Judgement.WITHIN

    @property
    def verdict(self) -> str:
        """Statement about the sum, in words; never that a function is sufficient."""
        words = {
            Judgement.NONE: "no level is required",
            Judgement.ABOVE: "PFH sum above the limit",
            Judgement.MISSING: f"not judged: no PFH of {', '.join(self.missing)}",
            Judgement.UNVERIFIED: f"not judged: unverified PFH of {', '.join(self.unverified)}",
            Judgement.WITHIN: "PFH sum within the limit",
        }
        return f"{words[self.judgement]}; {NOT_ASSESSED}"


def limit_of(function: SafetyFunction) -> float | None:
    """Return the upper bound of PFH of the required level; the stricter one of PL and SIL."""
    found = (_PL.get(function.pl), _SIL.get(function.sil or 0))
    bounds = [bound for bound in found if bound is not None]
    return min(bounds) if bounds else None


def sum_pfh(function: SafetyFunction, parts: FunctionParts, *, crosses_bus: bool) -> PfhSum:
    """Add up the PFH of all elements.

    Args:
        function: The safety function.
        parts: Its elements with their values.
        crosses_bus: Whether the function uses an FSoE connection.
    """
    # The residual error of FSoE counts once, however many connections there are.
    fsoe = FSOE_PFH if crosses_bus else 0.0
    known = [r.pfh.value for r in parts.rows if r.pfh.value is not None]
    return PfhSum(
        total=fsoe + sum(known),
        fsoe=fsoe,
        limit=limit_of(function),
        missing=tuple(r.element.name for r in parts.rows if r.pfh.value is None),
        unverified=tuple(
            r.element.name for r in parts.rows if r.pfh.value is not None and not r.pfh.answered_for
        ),
    )
