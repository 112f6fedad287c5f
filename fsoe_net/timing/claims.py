"""The level of a safety function by its elements: at most the lowest level that they claim.

Parts in series reach at most the lowest PL or SIL among them (ISO 13849-1, 6.2 and 6.3; IEC 62061
likewise), however small the sum of their PFH is. Levels are those claimed by the sources; category,
diagnostic coverage, common causes and software are not assessed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fsoe_net.dataclass import dataclass
from fsoe_net.model.safety import SafetyElement, SafetyFunction
from fsoe_net.timing.elements import FunctionParts
from fsoe_net.timing.judgement import Judgement
from fsoe_net.timing.pfh import PfhSum

# Related by PFH, ISO 13849-1; if one SIL covers two performance levels, the lower one counts.
_PL_OF_SIL = {1: "b", 2: "d", 3: "e"}
# No SIL corresponds to PL a (ISO 13849-1).
_SIL_OF_PL = {"a": 0, "b": 1, "c": 1, "d": 2, "e": 3}
_MOST_OF_CATEGORY = {"B": "b", "1": "c", "2": "d"}  # ISO 13849-1, annex K; 3 and 4 reach PL e


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelClaim:
    """The required level of a safety function and the lowest claim among its elements.

    Attributes:
        required: ``PL d``, ``SIL 2``; empty when none is required.
        lowest: Lowest claim of the elements; empty if no element has a claim.
        weakest: Elements with this lowest claim.
        by_sum: Level that the sum of PFH alone would allow; empty if the weakest elements claim as
            much, or if a PFH is missing.
        missing: Elements without a required claim.
        unverified: Elements whose claim is not verified.
        judgement: The lowest claim compared with the required level.
    """

    required: str
    lowest: str
    weakest: tuple[str, ...]
    by_sum: str
    missing: tuple[str, ...]
    unverified: tuple[str, ...]
    judgement: Judgement

    @property
    def verdict(self) -> str:
        """Statement about the claims, in words; never that a level is reached."""
        lowest = f"{self.lowest}, claimed by the source of {', '.join(self.weakest)}"
        return {
            Judgement.NONE: f"lowest claim: {lowest}" if self.lowest else "no level is claimed",
            Judgement.ABOVE: f"{self.required} is required, above the lowest claim: {lowest}",
            Judgement.MISSING: f"not judged: no PL or SIL claim of {', '.join(self.missing)}",
            Judgement.UNVERIFIED: f"not judged: unverified claim of {', '.join(self.unverified)}",
            Judgement.WITHIN: f"no claim is below {self.required}; lowest: {lowest}",
        }[self.judgement]

    @property
    def sum_words(self) -> str:
        """Return that the sum of PFH alone would claim too much; empty if it would not."""
        if not self.by_sum:
            return ""
        lowest = f"more than the lowest claim, {self.lowest}"
        return f"the PFH sum alone would fit {self.by_sum}: {lowest}"


def level_claims(
    function: SafetyFunction, parts: FunctionParts, pfh: PfhSum
) -> tuple[LevelClaim, ...]:
    """Return a claim for PL and for SIL, if required; otherwise for the claimed levels.

    Args:
        function: The safety function.
        parts: Its elements.
        pfh: Their sum.
    """
    # A sum with missing parts would reach a level that the whole does not reach.
    pl_of_sum, sil_of_sum = (0, 0) if pfh.missing else (_PL.index(pfh.pl or "-"), pfh.sil)
    found = []
    if function.pl or (function.sil is None and any(r.element.pl for r in parts.rows)):
        found.append(_claim(_PL_SCALE, _PL.index(function.pl or "-"), pl_of_sum, parts))
    # Without a requirement, one scale is sufficient to show the claims of the elements.
    if function.sil is not None or not found:
        found.append(_claim(_SIL_SCALE, function.sil or 0, sil_of_sum, parts))
    return tuple(found)


def most_of_category(element: SafetyElement) -> str:
    """Return the highest PL of the category of an element that claims more; empty otherwise."""
    most = _MOST_OF_CATEGORY.get(element.category, "e")
    return most if element.pl > most else ""


_PL, _SIL = "-abcde", "-123"  # by rank; 0 means none


def _pl(element: SafetyElement) -> int | None:
    claimed = most_of_category(element) or element.pl or _PL_OF_SIL.get(element.sil or 0)
    return None if claimed is None else _PL.index(claimed)


def _sil(element: SafetyElement) -> int | None:
    if element.sil is not None:
        return element.sil
    return _SIL_OF_PL.get(most_of_category(element) or element.pl)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scale:
    """Levels by rank, 0 for none, and the rank claimed by an element; ``None`` without a claim."""

    word: str
    names: str
    rank_of: Callable[[SafetyElement], int | None]

    def words(self, rank: int) -> str:
        return f"{self.word} {self.names[rank]}" if rank else f"no {self.word}"


_PL_SCALE = _Scale(word="PL", names=_PL, rank_of=_pl)
_SIL_SCALE = _Scale(word="SIL", names=_SIL, rank_of=_sil)


def _once(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(names))


def _claim(scale: _Scale, required: int, by_sum: int, parts: FunctionParts) -> LevelClaim:
    ranks = [(r, scale.rank_of(r.element)) for r in parts.rows]
    claimed = [(r, rank) for r, rank in ranks if rank is not None]
    lowest = min((rank for _, rank in claimed), default=None)
    missing = _once(r.element.name for r in parts.rows if r.has_no_claim)
    unverified = _once(r.element.name for r, _ in claimed if not r.claim_answered_for)
    return LevelClaim(
        required=scale.words(required) if required else "",
        lowest="" if lowest is None else scale.words(lowest),
        weakest=_once(r.element.name for r, rank in claimed if rank == lowest),
        by_sum=scale.words(by_sum) if lowest is not None and by_sum > lowest else "",
        missing=missing,
        unverified=unverified,
        judgement=_judged(required, lowest, is_whole=not missing, is_sourced=not unverified),
    )


def _judged(required: int, lowest: int | None, *, is_whole: bool, is_sourced: bool) -> Judgement:
    """Return the lowest claim compared with the requirement; missing claims can only lower it."""
    if not required:
        return Judgement.NONE
    # Known to be too low, whatever the missing claims are.
    if lowest is not None and lowest < required:
        return Judgement.ABOVE
    if lowest is None or not is_whole:
        return Judgement.MISSING
    return Judgement.WITHIN if is_sourced else Judgement.UNVERIFIED
