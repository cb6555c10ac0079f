"""How far a stage can be trusted, for its section of a report: what its logs told, what speaks against it, looks, heat balances."""

from __future__ import annotations

from thermid.campaign.joint import JointFit
from thermid.campaign.stages import Campaign
from thermid.errors import ThermidError
from thermid.explain.balance import energy_balance
from thermid.explain.criticism import criticise
from thermid.fit.calibration import Calibration
from thermid.inference.identifiability import identifiability

MOST = 12
"""Records of a stage up to which the page says of each trace what is left in it."""


def trust(campaign: Campaign, c: Calibration) -> tuple[tuple[str, str], ...]:
    """Return titles with texts: what the logs told of the stage's values, what its residuals say, who looked, where measured heat goes."""
    parts = []
    if c.values.parameters and not isinstance(c, JointFit):
        parts.append(("What the logs told of its values", _said(lambda: str(identifiability(c)))))
    known = {e.record.name for e in c.experiments}
    if len(known) > MOST:
        parts.append(
            ("What its residuals say", f"{len(known)} records: td.criticise(campaign[{c.stage!r}], elements=False) says it of each.")
        )
    elif c.request is not None and not isinstance(c, JointFit) and all(b.record in known for b in c.blocks):
        parts.append(("What its residuals say", _said(lambda: str(criticise(c, elements=False)))))
    looks = _looks(campaign, c)
    if looks:
        parts.append(("Who looked at its held-out records", looks))
    balances = _balances(campaign, c)
    if balances:
        parts.append(("Where the heat of its steady points goes", balances))
    return tuple(parts)


def _said(make: object) -> str:
    """Return a finding, or why there is none."""
    assert callable(make)
    try:
        return str(make())
    except ThermidError as error:
        return f"not to be had: {error.message}"


def _looks(campaign: Campaign, c: Calibration) -> str:
    lines = []
    for v in campaign.verdicts:
        if v.model == c.stage:
            if v.passed is None:
                lines.append(f"{v.record}: not judged, not opened; {v.standing.reason(v.model)}")
                continue
            word = "passed" if v.passed else "failed"
            before = (
                f"{len(v.failed_before)} failed verdicts before, by other values: no longer unseen"
                if v.failed_before
                else "unseen till then"
            )
            lines.append(f"{v.record}: {word}, {before}{', conditional on values fitted to it' if v.conditional else ''}")
    return "\n".join(lines)


def _balances(campaign: Campaign, c: Calibration) -> str:
    """Return the heat balance of every steady point that the stage fitted."""
    source = campaign.source
    stage = next((s for s in source.content.stages if s.name == c.stage), None) if source is not None else None
    if source is None or stage is None:
        return ""
    out = []
    for name, table in stage.steady.items():
        (one,) = source.pick([table.record], name)[:1]
        log = source.bound(one, stage)
        out.append(f"{name}: " + _said(lambda: energy_balance(c, log, table.start, table.end, limit=table.limit)))  # noqa: B023
    return "\n\n".join(out)
