"""What a plan predicts at its sensors before any log is read."""

from __future__ import annotations

from typing import Any

from thermid.physics.constants import ICE_POINT
from thermid.qualify.plan import Plan
from thermid.qualify.trying import sensors_of, tried


def pre_test(plan: Plan) -> dict[str, dict[str, dict[str, Any]]]:
    """Return test -> sensor -> lowest, highest and last expected temperature, each with its standard error; no log is read."""
    out: dict[str, dict[str, dict[str, Any]]] = {}
    for test in plan.tests:
        told = tried(plan, test.model_copy(update={"log": None})).foresight.prediction
        out[test.name] = {}
        for sensor, (node, _) in sensors_of(plan, test).items():
            band = told[node]
            error, kelvin = band.error, band.kelvin
            places = {"lowest": int(kelvin.argmin()), "highest": int(kelvin.argmax()), "last": -1}
            out[test.name][sensor] = {f"{word}_C": round(float(kelvin[k]) - ICE_POINT, 3) for word, k in places.items()}
            out[test.name][sensor] |= {f"{word}_error_K": round(float(error[k]), 4) for word, k in places.items()}
    return out
