"""Component -> submodel from one campaign file: stages, priors handed upward, a verdict on a held-out log. The logs are synthetic."""

import sys
from pathlib import Path

from make_logs import main as make_logs

import thermid as td

here = Path(__file__).parent
logs = Path(sys.argv[1]) if len(sys.argv) > 1 else here
make_logs(logs / "logs")
campaign = td.run_stages(here / "campaign.toml", data=logs)
print(campaign)
for part, levels in campaign.table("effective_htc").items():
    print(part, {stage: round(value, 3) for stage, value in levels.items()})
