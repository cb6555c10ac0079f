"""What a study lists: physical items, kinds of sensors, actions of its procedure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Component:
    """A physical item of the subject.

    Parameters
    ----------
    at : str                        Path of its submodel or node in the model of the whole.
    what : str                      What it is.
    lowest, highest : float or None Limits at its reference points. [K]
    basis : str                     What the limits rest on.
    """

    at: str
    what: str = ""
    lowest: float | None = None
    highest: float | None = None
    basis: str = ""

    def holds(self, path: str) -> bool:
        """Whether a node belongs to it."""
        return path == self.at or path.startswith(f"{self.at}.")


@dataclass(frozen=True)
class SensorSpec:
    """What a kind of sensor is said to do.

    Parameters
    ----------
    accuracy : float        Largest error. [K]
    channels : tuple of str Patterns of the channels of the campaign that it stands behind.
    resolution : float      LogEntry of its readings; 0 where none is given. [K]
    range : tuple           Lowest and highest temperature, empty where none is given. [K]
    conversion : float      Time from the instant of a value to its reading. [s]
    certificate : str       How it was calibrated.
    basis : str             Where this is said.
    """

    accuracy: float
    channels: tuple[str, ...]
    resolution: float = 0.0
    range: tuple[float, ...] = ()
    conversion: float = 0.0
    certificate: str = ""
    basis: str = ""


@dataclass(frozen=True)
class ProcedureAction:
    """One action of the procedure: its name, its state, the stages that do it, a note."""

    name: str
    state: Literal["done", "with qualification", "open"] = "open"
    stages: tuple[str, ...] = ()
    note: str = ""
