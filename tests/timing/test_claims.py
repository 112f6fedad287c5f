"""The lowest claim of a safety function, worked out by hand, and what is said about it."""

from __future__ import annotations

import pytest
from changed import figures
from timing.made_budget import FUNCTION, Maker, budget_of

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.rules.timing import check_timing
from fsoe_net.timing.claims import LevelClaim
from fsoe_net.timing.judgement import Judgement

INPUT = "source: manual,\n         claim: {pl: d}"
"""What follows the PFH of the input."""


def judged(
    maker: Maker, *edits: tuple[str, str]
) -> tuple[tuple[LevelClaim, ...], list[Diagnostic]]:
    text = FUNCTION
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new, 1)
    resolution = maker(text)
    budget = budget_of(resolution)
    return budget.functions[0].levels, check_timing(resolution.network, budget)


@pytest.mark.shows("R28")
@pytest.mark.parametrize(
    ("required", "claim", "lowest", "judgement"),
    [
        ("{pl: d}", "{pl: d}", "PL d", Judgement.WITHIN),
        ("{pl: d}", "{pl: e}", "PL d", Judgement.WITHIN),  # the others claim d
        ("{pl: d}", "{pl: c}", "PL c", Judgement.ABOVE),
        ("{pl: d}", "{pl: a}", "PL a", Judgement.ABOVE),
        ("{pl: d}", "{sil: 2}", "PL d", Judgement.WITHIN),
        ("{pl: d}", "{sil: 1}", "PL b", Judgement.ABOVE),  # SIL 1 spans b and c
        ("{pl: c}", "{sil: 1}", "PL b", Judgement.ABOVE),
        ("{pl: b}", "{sil: 1}", "PL b", Judgement.WITHIN),
        ("{pl: d}", "{pl: c, sil: 3}", "PL c", Judgement.ABOVE),  # its own word counts
        ("{pl: d}", "{pl: d}, category: 3", "PL d", Judgement.WITHIN),
        ("{pl: d}", "{pl: d}, category: 2", "PL d", Judgement.WITHIN),
        ("{pl: d}", "{pl: d}, category: 1", "PL c", Judgement.ABOVE),
        ("{pl: c}", "{pl: c}, category: b", "PL b", Judgement.ABOVE),
        ("{sil: 2}", "{sil: 2}", "SIL 2", Judgement.WITHIN),
        ("{sil: 2}", "{pl: c}", "SIL 1", Judgement.ABOVE),
        ("{sil: 1}", "{pl: a}", "no SIL", Judgement.ABOVE),
        ("{sil: 1}", "{pl: b}", "SIL 1", Judgement.WITHIN),
        ("{sil: 3}", "{pl: e}", "SIL 2", Judgement.ABOVE),  # the others claim d
    ],
)
def test_the_lowest_claim_is_judged(
    resolution_of: Maker, required: str, claim: str, lowest: str, judgement: Judgement
) -> None:
    edits = (
        ("required: {pl: d}", f"required: {required}"),
        (INPUT, f"source: manual, claim: {claim}"),
    )
    (level,), found = judged(resolution_of, *edits)
    assert (level.lowest, level.judgement) == (lowest, judgement)
    above = [d.message for d in found if d.code == "FSN613"]
    assert bool(above) is (judgement is Judgement.ABOVE)
    assert all(lowest in words for words in above)


def test_both_levels_are_judged_where_both_are_required(resolution_of: Maker) -> None:
    levels, found = judged(resolution_of, ("{pl: d}", "{pl: d, sil: 3}"))
    assert [(c.required, c.lowest, c.judgement.value) for c in levels] == [
        ("PL d", "PL d", "within"),
        ("SIL 3", "SIL 2", "above"),
    ]
    assert [d.code for d in found if d.code == "FSN613"] == ["FSN613"]


@pytest.mark.shows("R28")
def test_the_sum_alone_would_claim_more(resolution_of: Maker) -> None:
    # 1.44e-8 keeps the limit of PL e, 1e-7; each part claims PL d.
    (level,), _ = judged(resolution_of)
    assert level.by_sum == "PL e"
    assert level.sum_words == "the PFH sum alone would fit PL e: more than the lowest claim, PL d"
    # 2e-7 fits PL d, as the parts claim.
    (level,), _ = judged(resolution_of, ("1.0e-8", "2.0e-7"))
    assert (level.by_sum, level.sum_words) == ("", "")
    # What is missing can only add to the sum.
    (level,), _ = judged(resolution_of, ("pfh_per_hour: 1.0e-8, ", ""))
    assert level.by_sum == ""


@pytest.mark.shows("R28")
def test_a_missing_claim_is_named_and_a_low_one_still_counts(resolution_of: Maker) -> None:
    (level,), found = judged(resolution_of, (INPUT, "source: manual"))
    assert (level.judgement, level.missing) == (Judgement.MISSING, ("el1904",))
    assert level.verdict == "not judged: no PL or SIL claim of el1904"
    assert [figures(d.message) for d in found if d.code == "FSN606"] == ["el1904"]
    low = (
        "1.03e-9, source: manual,\n         claim: {pl: d}",
        "1.03e-9, source: manual, claim: {pl: c}",
    )
    (level,), found = judged(resolution_of, (INPUT, "source: manual"), low)
    assert (level.judgement, level.weakest) == (Judgement.ABOVE, ("el6910",))
    assert {"FSN606", "FSN613"} <= {d.code for d in found}


def test_no_claim_at_all_and_no_level_required(resolution_of: Maker) -> None:
    text = FUNCTION.replace(",\n         claim: {pl: d}", "").replace("    required: {pl: d}\n", "")
    resolution = resolution_of(text)
    budget = budget_of(resolution)
    (level,) = budget.functions[0].levels
    assert (level.verdict, level.sum_words) == ("no level is claimed", "")
    assert "FSN606" not in {d.code for d in check_timing(resolution.network, budget)}


def test_a_claim_needs_a_source(resolution_of: Maker) -> None:
    (level,), found = judged(resolution_of, (INPUT, "source: tbd, claim: {pl: d}"))
    assert (level.judgement, level.unverified) == (Judgement.UNVERIFIED, ("el1904",))
    assert level.verdict == "not judged: unverified claim of el1904"
    assert [d.code for d in found if d.code == "FSN607"] == ["FSN607"]


@pytest.mark.shows("R28")
@pytest.mark.parametrize(
    ("reason", "is_open"),
    [("", True), (", zero_because: tbd", True), (", zero_because: 0", True),
     (", zero_because: the drive takes the torque off", False)],
)  # fmt: skip
def test_zero_needs_a_reason(resolution_of: Maker, reason: str, is_open: bool) -> None:
    old = "time_ms: 4, pfh_per_hour: 1.11e-9, source: manual"
    new = f"time_ms: 0, pfh_per_hour: 0, source: manual{reason}"
    text = FUNCTION.replace(old, new)
    resolution = resolution_of(text)
    budget = budget_of(resolution)
    (row,) = budget.functions
    assert row.judgement is (Judgement.UNVERIFIED if is_open else Judgement.WITHIN)
    assert row.pfh.judgement is (Judgement.UNVERIFIED if is_open else Judgement.WITHIN)
    found = check_timing(resolution.network, budget)
    named = [d.message for d in found if d.code == "FSN612"]
    assert [figures(text) for text in named] == (["0 el1904"] * 2 if is_open else [])
    assert [key in text for key, text in zip(("time_ms", "pfh_per_hour"), named, strict=False)] == (
        [True, True] if is_open else []
    )
    assert "FSN607" not in {d.code for d in found}  # one mistake, one finding


def test_a_claim_above_its_category_is_named(resolution_of: Maker) -> None:
    _, found = judged(resolution_of, (INPUT, "source: manual, claim: {pl: e}, category: 2"))
    (one,) = (d for d in found if d.code == "FSN614")
    assert figures(one.message) == "el1904 2"
    assert [level in one.message for level in ("PL d", "PL e")] == [True, True]
