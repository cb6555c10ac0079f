"""Radau IIA of order 5, by which films and vapour step: its published coefficients."""

from typing import Final

import numpy as np

_ROOT = 6.0**0.5
RADAU_C: Final = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
RADAU_A: Final = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)
"""Nodes and weights: Hairer and Wanner, Solving Ordinary Differential Equations II, 2nd ed., section IV.5."""
