"""Old names of attributes, served with a warning until `REMOVED`: the one table of what users may still write."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

REMOVED: Final = "0.3.0"
"""Version that serves none of them any more."""

RENAMED: Final[Mapping[str, Mapping[str, str]]] = {
    "Calibration": {"wander": "autocorrelation", "effective": "effective_samples"},
    "Autocorrelation": {"level": "variance_factor", "excess": "score_excess", "effective": "effective_samples"},
    "TraceNoise": {
        "own": "white_variance",
        "slow": "correlated_variance",
        "time": "correlation_time",
        "effective": "effective_samples",
    },
    "Check": {"name": "criterion", "worst": "sensor"},
    "Deviation": {key: f"[{key}]" for key in ("mean", "spread", "largest", "rmse")},
    "LogEntry": {key: f"[{key}]" for key in ("rmse", "max_error", "final_error")},
}
"""Class -> old attribute -> new one; a name in brackets is a key of the object."""


class Renamed:
    """Base of a class of which attributes have new names; see `RENAMED`."""

    if not TYPE_CHECKING:  # a type checker knows the new names only

        def __getattr__(self, name: str) -> Any:
            """Return what stands under the new name, with a warning that says it.

            Raises
            ------
            AttributeError   When it is no old name.
            """
            tables = (RENAMED.get(each.__name__, {}) for each in type(self).__mro__)  # a joint fit is a calibration too
            new = next((table[name] for table in tables if name in table), None)
            if new is None:
                raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
            shown = f'["{new[1:-1]}"]' if new.startswith("[") else f".{new}"
            text = f"'.{name}' was renamed to '{shown}'; the old name will be removed in thermid {REMOVED}."
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return self[new[1:-1]] if new.startswith("[") else getattr(self, new)
