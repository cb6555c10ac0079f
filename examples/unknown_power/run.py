"""The power of a heater that regulates itself, recovered from the temperature of its case; the log is synthetic."""

from pathlib import Path

import numpy as np

import thermid as td

here = Path(__file__).parent
gyro = td.load_model(here / "gyro.toml")
KNOWN, HOURS, EVERY = 3.0, 12.0, 20.0
WINDOW = "10 [min]"


def planted(seed: int = 1) -> tuple[td.Record, np.ndarray, np.ndarray]:
    """Return a log, and times [s] and powers [W] of what made it: 5 W for three hours, then a controller that aims at 52 degC."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, HOURS * 3600.0 + 1.0, EVERY)
    room = 293.15 + 6.0 * np.sin(2.0 * np.pi * times / (8.0 * 3600.0))
    true = gyro.with_values({"mass": "0.80 [kg]", "skin.effective_htc": "5.6 [W/(m^2 K)]"})
    early, late = times <= KNOWN * 3600.0, times >= KNOWN * 3600.0
    first = td.Scenario(
        "step", {"cv": (times[early], td.quantity(room[early], unit="K"))}, {"heater": "5 [W]"}, start="cv", duration=KNOWN * 3600.0
    )
    step = td.simulate(true, first, times=times[early])
    deck = {
        "title": "Gyro that regulates itself",
        "needs": ["cv"],
        "nodes": {"case": {"mass": "0.80 [kg]", "specific_heat": "960 [J/(kg K)]"}},
        "surfaces": {"skin": {"of": "case", "to": "cv", "area": "0.0365 [m^2]", "effective_htc": "5.6 [W/(m^2 K)]"}},
        "loads": {
            "electronics": {"into": "case", "power": "2.74 [W]"},
            "heater": {"into": "case", "power": "6 [W]", "proportional": {"gain": "1.5 [W/K]", "setpoint": "52 [degC]"}},
        },
    }
    ends = td.celsius(step["case"].final)
    second = td.Scenario(
        "regulated",
        {"cv": (times[late] - times[late][0], td.quantity(room[late], unit="K"))},
        start=ends,
        duration=(HOURS - KNOWN) * 3600.0,
    )
    run = td.simulate(td.model_from_dict(deck), second, times=times[late] - times[late][0])
    case = np.concatenate([step["case"].kelvin, run["case"].kelvin[1:]])
    error = 0.2 * rng.standard_normal() + 0.02 * rng.standard_normal(times.size)
    channels = {
        "T_CASE": td.Channel.from_array(
            "T_CASE",
            case + error,
            unit="K",
            role="node",
            target="case",
            noise=0.02,
            accuracy=0.2,
        ),
        "T_ROOM": td.Channel.from_array("T_ROOM", room, unit="K", role="boundary", target="cv"),
    }
    heater = np.where(early, 5.0, 0.0)
    heater[late] = np.clip(1.5 * (52.0 + 273.15 - run["case"].kelvin), 0.0, 6.0)
    return td.Record.from_arrays("gyro", times, channels), times, heater


def recovered(record: td.Record) -> td.inference.PowerHistory:
    """Return the heater's power; the known step gives the mass and the coefficient."""
    known = [("0 [h]", f"{KNOWN} [h]", "5 [W]")]
    return td.inference.power_history(gyro, record, "heater", known=known, free=["mass", "skin.effective_htc"], every="5 [min]")


def compared(history: td.inference.PowerHistory, times: np.ndarray, heater: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return error [W] and standard deviation [W] of the mean power of every window in which it was unknown, and the planted mean. [W]"""
    middle, mean, sd = history.averaged(WINDOW)
    late = middle > KNOWN * 3600.0 + 600.0
    whole = np.concatenate([[0.0], np.cumsum(0.5 * (heater[1:] + heater[:-1]) * np.diff(times))])
    truth = (np.interp(middle + 300.0, times, whole) - np.interp(middle - 300.0, times, whole)) / 600.0
    return (mean - truth)[late], sd[late], float(truth[late].mean())


if __name__ == "__main__":
    log, times, heater = planted()
    history = recovered(log)
    error, sd, mean = compared(history, times, heater)
    print(history)
    print(
        f"synthetic log; of {error.size} means over {WINDOW}: RMS error {np.sqrt(np.mean(error**2)) / mean:.1%} of the planted mean, "
        f"largest {np.abs(error).max() / mean:.1%}; in {np.mean(np.abs(error) < 1.96 * sd):.0%} the 95 % interval holds the planted power"
    )
    for law in history.laws():
        print(f"  {law}")
    axes = history.plot()
    axes.plot(times, heater, "k--", linewidth=0.8, label="planted")
    axes.legend(frameon=False)
    (here / "out").mkdir(exist_ok=True)
    axes.figure.savefig(here / "out" / "power.png", dpi=120)
