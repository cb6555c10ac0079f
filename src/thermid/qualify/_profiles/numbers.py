"""Numbers and words that a profile may have, and their units: for the grammar and for what reads by it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from thermid.base.units import TEMPERATURE

SLOTS: Final[Mapping[str, str]] = {
    "hot": TEMPERATURE,
    "cold": TEMPERATURE,
    "middle": TEMPERATURE,
    "ambient": TEMPERATURE,
    "hot_least": TEMPERATURE,
    "cold_least": TEMPERATURE,
    "margin": "K",
    "tolerance": "K",
    "ramp": "K/s",
    "ramp_least": "K/s",
    "cycles": "1",
    "base_cycles": "1",
    "base_range": "K",
    "range_exponent": "1",
    "dwell": "s",
    "soak": "s",
    "soak_ends": "s",
    "operate": "s",
    "operate_ends": "s",
    "off": "s",
    "pressure": "Pa",
    "rough_pressure": "Pa",
    "pump_down": "s",
    "humidity": "1",
    "longest_wait": "s",
    "average": "s",
}
"""Numbers of a profile -> their unit."""

USUAL: Final[Mapping[str, str]] = {TEMPERATURE: "degC", "K/s": "K/min", "s": "h"}
"""Unit of a number -> the one that a person means who writes none."""

WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "stable": (),
    "starts": ("each", "first and last", "never"),
    "first": ("hot", "cold"),
    "last": ("hot", "cold"),
}
"""Words of a profile -> what they may be; the rule of stability is checked by itself."""
