"""Looks at logs, and what a drawing of a course keeps."""

from thermid.reporting._pictures.chart import thinned as thinned
from thermid.reporting._pictures.look import (
    Look as Look,
    clock_lines as clock_lines,
    clocks_of as clocks_of,
    look as look,
    named_apart as named_apart,
    offset_range as offset_range,
    stated_offset as stated_offset,
)
