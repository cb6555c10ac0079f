"""The main job, end to end: synthetic logs of a hidden stack, a campaign over them, vacuum, and one report page.

Run by ``make demo``. The logs are made here and labelled as synthetic; examples/tclab does the same on measured ones.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import thermid as td

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "04_campaign"))

from make_logs import main as make_logs  # noqa: E402


def main(folder: Path) -> Path:
    """Run the demonstration into a folder and return the path of the page."""
    begun = time.monotonic()

    def say(text: str) -> None:
        print(f"[{time.monotonic() - begun:5.1f} s] {text}", flush=True)

    say("making synthetic logs of a hidden stack: processor, gyro supply, and both together")
    make_logs(folder / "logs")
    say("calibrating: ProcSISNAV -> EleGFO -> m_PrE, then judging a log that no stage has seen")
    last = ""

    def notice(stage: str, count: int, rms: float) -> None:
        nonlocal last
        if stage != last:
            last = stage
            say(f"  {stage}")

    campaign = td.run_stages(HERE / "04_campaign" / "campaign.toml", data=folder, notice=notice)
    for stage in campaign:
        for path, value in campaign[stage].values.parameters.items():
            say(f"  {stage}: {path} = {value.in_unit:.4g} +- {value.shown(value.error):.2g} {value.unit}")
    for verdict in campaign.verdicts:
        say(f"  {verdict.record}: {'passed' if verdict.passed else 'FAILED'}")
    say("predicting: the fitted stack on the bench, and in vacuum as the source document prints it (a bound)")
    fitted = campaign["m_PrE"].fitted_model
    bench = td.Scenario("bench at 24 degC", boundaries={"cv": "24 [degC]"}, duration="5 [h]")
    scenarios = [(s.title, td.simulate(fitted, s)) for s in (bench, bench.vacuum(as_printed=True))]
    campaign.save(folder / "results")
    page = td.report(campaign, to=folder / "report.html", scenarios=scenarios)
    say("done")
    print(f"\nreport page: {page}")
    return page


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out") / "demo")
