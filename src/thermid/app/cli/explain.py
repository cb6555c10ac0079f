"""Commands that explain a fit: criticise (what its residuals ask for), plausibility (whether its values are physical)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from thermid.app.cli.options import CampaignPath, Cluster, Data, Json, Processes, Results, Whole, executor_of, leave, pairs, say, staged
from thermid.app.cli.screen import working
from thermid.base.errors import NameNotFoundError, nearest
from thermid.fit.calibration import Calibration
from thermid.inference import criticism
from thermid.inference.diagnosis import plausibility as ranges_of
from thermid.model.elements import worst

Stage = Annotated[str, typer.Option("--stage", help="One stage; all that were fitted to logs without it.")]


def _fits(campaign: Path, stage: str, data: Path | None, results: Path | None) -> Mapping[str, Calibration]:
    """Return the fits of a stage, or of all stages that were fitted to logs.

    Raises
    ------
    NameNotFoundError   When no stage of that name was fitted to logs.
    """
    done = staged(campaign, data, results).stages
    fitted = {name: fit for name, fit in done.items() if fit.records}
    if not stage:
        return fitted
    if stage not in fitted:
        why = "was tuned by hand, so it has no residuals" if stage in done else "is not in this campaign"
        raise NameNotFoundError(f"stage '{stage}' {why}.{nearest(stage, fitted)}", campaign.name)
    return {stage: fitted[stage]}


def criticise(
    campaign: CampaignPath,
    stage: Stage = "",
    data: Data = None,
    results: Results = None,
    workers: Processes = 1,
    cluster: Cluster = "",
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Test the residuals of a fit and try missing elements.

    Missing elements are tried in refits where the residuals are more than noise.
    """
    fits = _fits(campaign, stage, data, results)
    criticisms = {}
    with working("") as progress:
        for k, (name, fit) in enumerate(fits.items()):
            progress.now(f"refits of stage {name}", k / len(fits))
            criticisms[name] = criticism.criticise(fit, executor=executor_of(workers, cluster))
    say(as_json, {"stages": {n: c.to_dict() for n, c in criticisms.items()}}, "\n\n".join(map(str, criticisms.values())), verbose)
    leave(worst(f.standing for f in fits.values()))


def plausibility(
    campaign: CampaignPath,
    stage: Stage = "",
    weight: Annotated[
        list[str], typer.Option("--weight", help="NODE=MASS of a part that was weighed, such as case='0.41 [kg]'; may be repeated.")
    ] = [],  # noqa: B006
    delivered: Annotated[
        list[str], typer.Option("--delivered", help="LOAD=POWER that a converter hands on, such as loss='20 [W]'; may be repeated.")
    ] = [],  # noqa: B006
    data: Data = None,
    results: Results = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Compare fitted values with correlations and physical ranges.

    Exit code 1 if a value is not physical.
    """
    weights, powers = pairs(weight, "--weight"), pairs(delivered, "--delivered")
    fits = _fits(campaign, stage, data, results)
    checks = {name: ranges_of(fit, weights=weights, delivered=powers) for name, fit in fits.items()}
    say(as_json, {"stages": {n: p.to_dict() for n, p in checks.items()}}, "\n\n".join(map(str, checks.values())), verbose)
    leave(worst(f.standing for f in fits.values()), 0 if all(p.physical for p in checks.values()) else 1)
