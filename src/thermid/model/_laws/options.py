"""The few words that a deck may choose from."""

from __future__ import annotations

from typing import Literal

Source = Literal["published", "datasheet", "derived", "assumed", "measured"]
Box = Literal["white", "light grey", "dark grey", "black"]
StandsFor = Literal["air", "walls", "air and walls"]
CarriedBy = Literal["free air", "fan", "cold plate", "leads"]
