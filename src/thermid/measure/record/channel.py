"""One measured channel, and where its samples came from."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermid.errors import RecordError, nearest

if TYPE_CHECKING:
    from thermid.measure.record.sensor import SensorPart

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

ROLES: Final = ("auto", "node", "boundary", "load", "command", "prescribed")
HELD: Final = frozenset({"power", "command"})
"""Quantities that keep their value until the next sample (zero-order hold); all others run straight from sample to sample."""

SAMPLES: Final = ("instant", "average")
"""What a sample of a log may be: the value at its stamp, or the mean over the interval that ends there."""

_SI: Final = {"temperature": "K", "power": "W", "command": "1"}


@dataclass(frozen=True)
class Origin:
    """Where a record came from. Trimmed, filtered and resampled copies keep it, so it is the identity of the data.

    Parameters
    ----------
    file : str              Name of the file without its folder, or the name of a synthetic record.
    sha256 : str            Hash of the parsed samples, see `digest`.
    start : str or None     First stamp as written, where the log has stamps.
    columns : tuple of str  Column names in file order, without their units.
    rows : int              Lines with samples.
    time : str              Name of the time column.
    synthetic : bool        Whether the samples were made and not measured.
    """

    file: str
    sha256: str
    start: str | None
    columns: tuple[str, ...]
    rows: int
    time: str = "time"
    synthetic: bool = False


def digest(columns: Iterable[tuple[str, ArrayLike]]) -> str:
    """Return the SHA-256 of named columns: time first, then every numeric column in file order.

    Each column is its name (UTF-8), a zero byte, and its samples as little-endian float64, with one form of NaN and of zero. Compression,
    separator, decimal sign and number format of the file do not enter.
    """
    total = hashlib.sha256()
    for name, values in columns:
        samples = np.array(values, dtype="<f8") + 0.0  # -0.0 becomes 0.0
        samples[np.isnan(samples)] = np.nan
        total.update(name.encode() + b"\0" + samples.astype("<f8").tobytes())
    return total.hexdigest()


def frozen(values: ArrayLike, kind: Any) -> NDArray[Any]:
    """Return a copy that cannot be written to."""
    copy = np.array(values, dtype=kind)
    copy.flags.writeable = False
    return copy


@dataclass(frozen=True, eq=False)
class Channel:
    """Samples of one sensor or command, and what they are bound to.

    Parameters
    ----------
    name : str                      Its name in the record.
    values : array (samples,)       Samples; a masked sample keeps its number, a missing one is NaN. [SI]
    valid : array (samples,)        False where a sample is masked.
    quantity : str                  'temperature', 'power', 'command' or another word.
    role : str                      'auto', 'node', 'boundary', 'load', 'command' or 'prescribed' (a node that the reading drives).
    target : str or None            Path in the model.
    gain : str or None              Path of the parameter that turns a command into a power.
    noise : float or None           Standard deviation of one sample. [SI]
    accuracy : float or None        Standard deviation of the constant error. [SI]
    resolution : float or None      Smallest step of the sensor, where known. [SI]
    column : str                    Its column in the file.
    unit : str                      Its unit in the file; SI when it was not read from one.
    masks : mapping to arrays       Masked samples by reason, each (samples,).
    correction : float              What a certificate has taken off the readings. [SI]
    part : SensorPart or None       What else its sensor does: scale, lag, noise in time, mass, leads.
    prompt : bool                   Whether a power or command has a sample at every change, so that the log has its moment.
    samples : str                   Of what drives a model: ``instant`` or ``average`` (the mean over the interval up to the stamp), as
                                    somebody said; empty where nobody did, which is taken as instants.
    assumed : bool                  Whether nothing said its unit, so that the usual one was taken.

    Raises
    ------
    RecordError   When arrays differ in length, a valid sample is not finite, or role, noise, accuracy or resolution make no sense.
    """

    name: str
    values: FloatArray
    valid: BoolArray
    quantity: str = "temperature"
    role: str = "auto"
    target: str | None = None
    gain: str | None = None
    noise: float | None = None
    accuracy: float | None = None
    resolution: float | None = None
    column: str = ""
    unit: str = ""
    masks: Mapping[str, BoolArray] = field(default_factory=dict)
    correction: float = 0.0
    part: SensorPart | None = None
    prompt: bool = False
    samples: str = ""
    assumed: bool = False

    def __post_init__(self) -> None:
        """Check the parts against each other and lock the arrays."""
        where = f"channel '{self.name}'"
        values, valid = frozen(self.values, np.float64), frozen(self.valid, np.bool_)
        masks = {reason: frozen(mask, np.bool_) for reason, mask in self.masks.items() if np.any(mask)}
        if values.ndim != 1 or any(each.shape != values.shape for each in (valid, *masks.values())):
            raise RecordError("values, valid and masks must be one-dimensional and of one length.", where)
        if np.any(valid & ~np.isfinite(values)):
            raise RecordError("a valid sample is not finite. Mask it.", where)
        bare = ~valid & ~np.any([np.zeros_like(valid), *masks.values()], axis=0)
        for reason, part in (("not a number", np.isnan(values)), ("infinite", np.isinf(values)), ("masked", np.isfinite(values))):
            if np.any(bare & part):
                masks[reason] = frozen(masks.get(reason, False) | (bare & part), np.bool_)
        if self.samples not in ("", *SAMPLES):
            raise RecordError(f"its samples are 'instant' or 'average', not '{self.samples}'.", where)
        if self.role not in ROLES:
            raise RecordError(f"no role '{self.role}'; it is one of {', '.join(ROLES)}.{nearest(self.role, ROLES)}", where)
        for word, size, least in (
            ("noise", self.noise, "above"),
            ("accuracy", self.accuracy, "not below"),
            ("resolution", self.resolution, "above"),
        ):
            if size is not None and not (np.isfinite(size) and (size > 0 or (size == 0 and least == "not below"))):
                raise RecordError(f"its {word} is {size:g}; a finite number {least} zero is needed.", where)
        for key, value in (("values", values), ("valid", valid), ("masks", masks), ("unit", self.unit or _SI.get(self.quantity, "1"))):
            object.__setattr__(self, key, value)

    @classmethod
    def of(cls, name: str, values: ArrayLike, **fields: Any) -> Channel:
        """Return a channel of an array in SI, with samples that are not finite masked."""
        samples = np.asarray(values, dtype=np.float64)
        return cls(name, samples, np.isfinite(samples), **fields)

    @property
    def flags(self) -> dict[str, int]:
        """Masked samples, counted by reason."""
        return {reason: int(np.count_nonzero(mask)) for reason, mask in self.masks.items()}

    @property
    def held(self) -> bool:
        """Whether a sample holds until the next one."""
        return self.quantity in HELD

    def masked(self, where: ArrayLike, reason: str) -> Channel:
        """Return the same channel with some valid samples masked.

        Raises
        ------
        RecordError   When no valid sample would remain.
        """
        new = np.asarray(where, dtype=np.bool_) & self.valid
        masks = dict(self.masks)
        masks[reason] = masks.get(reason, np.zeros_like(self.valid)) | new
        return replace(self, valid=self.valid & ~new, masks=masks).checked()

    def checked(self) -> Channel:
        """Return the channel itself.

        Raises
        ------
        RecordError   When all samples are masked.
        """
        if not self.valid.any():
            counts = ", ".join(f"{reason} {count}" for reason, count in self.flags.items())
            raise RecordError(
                f"all {self.valid.size} samples are masked ({counts}). Leave the channel out, or keep a part where it works.",
                f"channel '{self.name}'",
            )
        return self

    def taken(self, keep: BoolArray) -> Channel:
        """Return the channel at some of its samples."""
        masks = {reason: mask[keep] for reason, mask in self.masks.items()}
        return replace(self, values=self.values[keep], valid=self.valid[keep], masks=masks).checked()
