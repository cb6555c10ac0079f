"""Looks at logs before anything is made of them, and at the clocks of several logs of one test."""

from thermid.measure._readers.look import (
    Look as Look,
    clock_lines as clock_lines,
    clocks_of as clocks_of,
    look as look,
    named_apart as named_apart,
    offset_range as offset_range,
    stated_offset as stated_offset,
)
