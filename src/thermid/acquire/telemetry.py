"""Binary telemetry of a unit: frames with sync word, counter and CRC; currents of AD590-type sensors through a resistor and an ADC.

The pattern for the accelerometer temperatures of the ProcSISNAV channel: a sensor that gives 1 uA/K drives a precision resistor, an ADC
counts its voltage, a frame carries the counts. A frame is, most significant byte first::

    EB 90 | counter (2) | unit time in ms (4) | number of channels n (1) | n counts (2 each) | CRC-16 (2)

The CRC is that of the bench's lines, over all that lies between sync and CRC.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thermid.errors import MissingDataError, NameNotFoundError, RecordError
from thermid.files import read_bytes
from thermid.measure.record.channel import Channel
from thermid.measure.record.record import Record

SYNC = b"\xeb\x90"
_HEAD = struct.Struct(">HIB")
_MOST_CHANNELS = 64


@dataclass(frozen=True)
class Chain:
    """From counts to temperature: counts -> voltage -> current -> temperature.

    Parameters
    ----------
    reference : float    Full scale of the ADC. [V]
    bits : int           Bits of the ADC.
    resistance : float   Resistor that the current passes. [ohm]
    scale : float        Current in one kelvin. [A/K]
    zero : float         Current at 0 K. [A]
    accuracy : float     Constant error of one channel as a standard deviation. [K]
    low, high : float    Range; what lies outside is a fault. [K]
    """

    reference: float = 5.0
    bits: int = 12
    resistance: float = 10e3
    scale: float = 1e-6
    zero: float = 0.0
    accuracy: float = 1.5
    low: float = 218.15
    high: float = 369.15

    def __post_init__(self) -> None:
        """Check the numbers."""
        for word in ("reference", "bits", "resistance", "scale"):
            if not getattr(self, word) > 0:
                raise RecordError(f"its {word} is {getattr(self, word):g}; it must be above zero.", "chain")
        if self.bits > 16:
            raise RecordError(f"its ADC has {self.bits} bits; a frame carries 16.", "chain")

    @property
    def step(self) -> float:
        """Temperature of one count [K]."""
        return self.reference / (1 << self.bits) / self.resistance / self.scale

    def temperature(self, counts: np.ndarray) -> np.ndarray:
        """Return temperatures of counts (samples,) [K]."""
        voltage = np.asarray(counts, dtype=np.float64) * (self.reference / (1 << self.bits))
        return np.asarray((voltage / self.resistance - self.zero) / self.scale)

    def counts(self, temperature: np.ndarray) -> np.ndarray:
        """Return the counts nearest to temperatures (samples,), held at the ends of the ADC [K -> 1]."""
        current = self.zero + self.scale * np.asarray(temperature, dtype=np.float64)
        return np.clip(np.rint(current * self.resistance / self.reference * (1 << self.bits)), 0, (1 << self.bits) - 1).astype(int)


@dataclass(frozen=True)
class Frame:
    """One frame that carried a good CRC.

    Parameters
    ----------
    counter : int           Counts frames, modulo 65536.
    ms : int                Time of the unit. [ms]
    counts : tuple of int   Of each channel.
    """

    counter: int
    ms: int
    counts: tuple[int, ...]


def frame_bytes(frame: Frame) -> bytes:
    """Return a frame as it is sent."""
    body = _HEAD.pack(frame.counter % 65536, frame.ms % (1 << 32), len(frame.counts)) + struct.pack(f">{len(frame.counts)}H", *frame.counts)
    return SYNC + body + struct.pack(">H", crc_hqx(body, 0xFFFF))


def read_frames(data: bytes) -> tuple[list[Frame], int]:
    """Return the frames of a stream and how many of its bytes belong to none.

    After damage the next sync word that begins a frame with a good CRC is taken; a sync word inside data only looks like one.
    """
    frames: list[Frame] = []
    at = used = 0
    while (at := data.find(SYNC, at)) >= 0:
        begin = at + len(SYNC)
        if begin + _HEAD.size > len(data):
            break
        counter, ms, channels = _HEAD.unpack_from(data, begin)
        end = begin + _HEAD.size + 2 * channels
        if not 0 < channels <= _MOST_CHANNELS or end + 2 > len(data) or crc_hqx(data[begin : end + 2], 0xFFFF) != 0:
            at += 1
            continue
        frames.append(Frame(counter, ms, struct.unpack_from(f">{channels}H", data, begin + _HEAD.size)))
        used += end + 2 - at
        at = end + 2
    return frames, len(data) - used


def read_telemetry(path: str | Path, channels: Mapping[str, int], chain: Chain | Mapping[str, Chain] | None = None) -> Record:
    """Return the temperatures of a telemetry file as a record, on the unit's own clock; `Record.joined` and `align` bring clocks together.

    Parameters
    ----------
    path : str or Path    File of frames.
    channels : mapping    Name -> place in the frame, from 0.
    chain : Chain         From counts to temperature, one for all or by name; by default that of the ProcSISNAV.

    Raises
    ------
    MissingDataError    When there is no such file.
    RecordError         When it has no two frames, its time runs back, or frames differ in their number of channels.
    NameNotFoundError   When a place is not in the frame.
    """
    place = Path(path)
    if not place.is_file():
        raise MissingDataError("there is no such telemetry file.", str(place))
    data = read_bytes(place)
    frames, foreign = read_frames(data)
    if len(frames) < 2:
        raise RecordError(f"it holds {len(frames)} good frames in {len(data)} bytes; a record needs two.", place.name)
    width = len(frames[0].counts)
    odd = next((k for k, frame in enumerate(frames) if len(frame.counts) != width), None)
    if odd is not None:
        raise RecordError(f"frame {odd + 1} has {len(frames[odd].counts)} channels, the first one {width}.", place.name)
    times = _unwrapped([frame.ms for frame in frames], 1 << 32) / 1000.0
    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        raise RecordError(
            f"time does not go on at frame {back[0] + 2}: {times[back[0]]:g} s, {times[back[0] + 1]:g} s. Was the unit reset?", place.name
        )
    counter = _unwrapped([frame.counter for frame in frames], 1 << 16)
    missing = int(counter[-1] - counter[0]) + 1 - len(frames)
    counts = np.array([frame.counts for frame in frames])
    made, notes = [], [f"frames {len(frames)}, missing {missing}, bytes that belong to none {foreign}"]
    for name, where in channels.items():
        if not 0 <= where < width:
            raise NameNotFoundError(f"channel '{name}' is to be at place {where}; a frame has 0 to {width - 1}.", place.name)
        own = chain.get(name, Chain()) if isinstance(chain, Mapping) else chain or Chain()
        made.append(_channel(name, own, counts[:, where]))
        notes += [f"{name}: masked {reason} {count}" for reason, count in made[-1].flags.items()]
    record = Record.from_arrays(place.stem, times, {each.name: each for each in made}, synthetic=False)
    return Record(record.name, record.times, record.channels, record.origin, tuple(notes))


def _unwrapped(values: Sequence[int], turn: int) -> np.ndarray:
    """Return a counter that goes on where it wrapped; a small step back stays one."""
    raw = np.array(values, dtype=np.int64)
    steps = np.mod(np.diff(raw) + turn // 2, turn) - turn // 2
    return np.asarray(raw[0] + np.concatenate([[0], np.cumsum(steps)]), dtype=np.float64)


def _channel(name: str, chain: Chain, counts: np.ndarray) -> Channel:
    """Return one channel, with what no sensor can show masked: an open or shorted line, or a value outside the range."""
    values = chain.temperature(counts)
    channel = Channel.of(name, values, accuracy=chain.accuracy, resolution=chain.step, column=name, unit="K")
    railed = (counts == 0) | (counts >= (1 << chain.bits) - 1)
    outside = ~railed & ((values < chain.low) | (values > chain.high))
    for reason, where in (("line open or shorted", railed), ("outside its range", outside)):
        if where.any():
            channel = channel.masked(where, reason)
    return channel
