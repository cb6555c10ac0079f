"""Readers of logs, in the formats of loggers and laboratories."""

from thermid.measure._readers.bindings import channel_schema as channel_schema
from thermid.measure._readers.formats import is_bench_log as is_bench_log, log_cells as log_cells
from thermid.measure._readers.guess import Column as Column
from thermid.measure._readers.headers import name_and_unit as name_and_unit
from thermid.measure._readers.log_reader import (
    log_columns as log_columns,
    parts_between_restarts as parts_between_restarts,
    read_plain as read_plain,
    read_record as read_record,
    temperature_columns as temperature_columns,
)
from thermid.measure._readers.matlab_objects import objects_of as objects_of, series_of as series_of
from thermid.measure._readers.textfile import UNFINISHED as UNFINISHED, Cells as Cells
