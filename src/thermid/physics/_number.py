"""What the functions of this room take and give back."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

# A float, an array, or any object with + - * / **; such objects (numbers with derivatives) share no type that mypy could name.
Number: TypeAlias = Any


def plain(value: Number) -> Number:
    """Return a Python float for a zero-dimensional numpy value, and anything else unchanged.

    >>> plain(np.sqrt(4.0))
    2.0
    """
    return float(value) if isinstance(value, np.ndarray | np.generic) and np.ndim(value) == 0 else value
