"""Two or three lines of names above the samples: the telling one is taken or all are combined, and said; contradictions are refused."""

from __future__ import annotations

import re

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.measure._readers.formats import log_cells
from thermid.measure._readers.headers import name_and_unit
from thermid.measure._readers.log_reader import read_record
from thermid.measure._readers.textfile import cells_of_text

NAMES = ("Zeit", "Gehäuse", "Luft")
UNITS = ("Zeit [s]", "Gehäuse [°C]", "Luft [°C]")
SAMPLES = "".join(f"{30 * k};{20 + k},5;20,5\n" for k in range(8))


@pytest.mark.parametrize(
    ("head", "header", "said"),
    [
        ("CH1;CH2;CH3\nZeit;Gehäuse;Luft\ns;°C;°C\n", UNITS, "\\b1\\b.*\\b2\\b.*\\b2\\b.*\\b1\\b.*\\(CH1, CH2, CH3\\)"),
        ("CH1;CH2;CH3\nZeit;Gehäuse;Luft\n", NAMES, "\\b2\\b"),
        (";CH1;CH2\nZeit;Gehäuse;Luft\n[s];[°C];[°C]\n", UNITS, "\\b2\\b"),
        ("1;2;3\nZeit;Gehäuse;Luft\ns;°C;°C\n", UNITS, "\\b2\\b.*\\b1\\b.*\\(1, 2, 3\\)"),
        ("Zeit;Gehäuse;Luft\nCH1;CH2;CH3\ns;°C;°C\n", UNITS, "\\b1\\b.*\\b2\\b"),
        ("Zeit;CH1;CH2\n;Gehäuse;Luft\ns;°C;°C\n", UNITS, "\\b2\\b.*\\(Zeit"),
        ("CH1;CH2;CH3\nPosition 1;Position 2;Position 3\nZeit;Gehäuse;Luft\ns;°C;°C\n", UNITS, "\\b1\\b.*\\b3\\b.*\\b3\\b"),
        ("CH1;CH2;CH3\nZeit;Gehäuse;Luft\ns;°C;°C\n;Avg;Avg\n", UNITS, "\\b2\\b"),
        ("Zeit;Gehäuse;Luft\nhh:mm;Typ K;Pt100\n", NAMES, "\\b1\\b"),
        ("Zeit;Gehäuse;Luft\n;Typ K;Typ K\n", NAMES, "\\b1\\b"),
        ("Logger;Halle;Nord\nZeit;Gehäuse;Luft\n", NAMES, "\\b2\\b"),
        ("CH1;CH2 (°F);CH3\nZeit;Gehäuse;Luft\n", ("Zeit", "Gehäuse [degF]", "Luft"), "\\b2\\b"),
        ("Zeit;T1;T2\n;Gehäuse;Luft\n", ("Zeit", "T1 Gehäuse", "T2 Luft"), "\\b1\\b.*\\b2\\b"),
        ("Zeit;Kammer;Schrank\n;Luft;Luft\ns;°C;K\n", ("Zeit [s]", "Kammer [°C]", "Schrank [K]"), "\\b1\\b"),
        ("Zeit;Temp;Temp\nCH1;CH2;CH3\n", ("Zeit", "Temp CH2", "Temp CH3"), "\\b1\\b.*\\b2\\b"),
        ("CH1;CH2;CH3;\nZeit;Gehäuse;Luft;\n", NAMES, "\\b2\\b"),
        (
            "Range;100C;100C\nComment;Gehäuse;Luft innen\nZeit;U1-1[C];U1-2[C]\n",
            ("Zeit", "Gehäuse [degC]", "Luft innen [degC]"),
            "\\b2\\b",
        ),
    ],
)
@pytest.mark.parametrize("above", ["", "Logger XY-12\nSerial;1234\n\n"])
def test_the_names_that_tell_are_taken_and_it_is_said(log, head, header, said, above):
    path = log(above + head + SAMPLES)
    cells = log_cells(path)
    assert cells.header == header
    assert len(cells.lines) == 8
    assert all(cells.columns[k][0] == first for k, first in enumerate(("0", "20,5", "20,5")))
    if not above:
        assert sum(bool(re.search(said, note)) for note in cells.notes) == 1
    told = td.look(path)
    assert not told.problem
    assert all(c.guess == "temperature" for c in told.columns if "innen" in c.name)
    assert any(line.removeprefix("note: ") in told.as_object()["notes"] for line in map(str.strip, told.lines()[:8]))


def test_groups_over_several_columns(log):
    path = log("Zeit;Kammer;;Schrank;\n;Wand;Luft;Wand;Luft\ns;°C;°C;°C;°C\n" + "".join(f"{k};1,5;2,5;3,5;4,5\n" for k in range(5)))
    channels = {"Kammer Luft": {"node": "a"}, "Schrank Wand": {"node": "b"}}
    record = read_record(path, channels)
    assert [record[name].values[0] - 273.15 for name in channels] == pytest.approx([2.5, 3.5])
    assert any("Kammer Wand, Kammer Luft, Schrank Wand" in note for note in record.steps)


@pytest.mark.parametrize(
    ("head", "code", "message"),
    [
        ("Zeit;Gehäuse;Luft\nWert;Uhrzeit;Luft\n", "record.time-unclear", "bench.csv:1.*1.*2.*'#'"),
        ("Zeit;CH1 (°C);CH2 (°C)\n;Gehäuse (°F);Luft\n", "record.unit-contradicts", "bench.csv:1.*1.*2"),
        ("Zeit;CH1 (°F);CH2\n;Gehäuse;Luft\ns;°C;°C\n", "record.unit-contradicts", "bench.csv:3"),
    ],
)
def test_contradictions_are_refused(log, head, code: str, message):
    path = log(head + SAMPLES)
    with raises_code(code, RecordError, match=message):
        td.look(path)
    mended = log("".join(line if k else f"#{line}" for k, line in enumerate(head.splitlines(keepends=True))) + SAMPLES)
    assert len(log_cells(mended).lines) == 8


def test_numbers_below_the_names_are_no_sample_without_a_word(log):
    with raises_code("record.layout-unclear", RecordError, match="bench.csv:2.*'1;2;3'"):
        log_cells(log("Zeit;Gehäuse;Luft\n1;2;3\n" + SAMPLES.replace("0;", "10;", 1)))
    assert len(log_cells(log("Zeit;Gehäuse;Luft\n1,0;2,0;3,0\n" + SAMPLES.replace("0;", "10;", 1))).lines) == 9


def test_one_name_for_two_columns_is_refused_where_it_is_used(log):
    path = log("Zeit;Temp;Temp\n;Luft;Luft\n" + SAMPLES)
    with raises_code("record.name-twice", RecordError, match="2.*'Temp Luft'"):
        read_record(path, {"Temp Luft": {"node": "a"}})


@pytest.mark.parametrize("row", [";OL;OL", "Mar 5 2026;Error;Error", "x;-;-", "10:00;OL;err"])
def test_a_sample_of_words_is_no_line_of_names(log, row):
    path = log(f"time;T1;T2\n{row}\n" + SAMPLES)
    assert log_cells(path).header == ("time", "T1", "T2")
    with pytest.raises(RecordError):
        read_record(path, {"T1": {"node": "a"}})


def test_channels_that_a_table_above_the_header_names_and_signs_apart_from_their_numbers(log):
    """As Graphtec loggers write: a table of channels, a row of units with words, numbers padded behind their sign, BURNOUT."""
    head = (
        '"Model","GL840-M"\n"CH","Signal name","Input"\n"CH1","LID","TEMP"\n"CH2","ROOM, left","TEMP"\n"Data"\n'
        '"Number","Date&Time","ms","CH1","CH2"\n"NO.","Time","ms","degC","degC"\n'
    )
    rows = [f'{k + 1},"2026/04/14 08:30:{20 * k:02d}","000","+  2{k}.50","-   {k}.25"\n' for k in range(3)]
    path = log(head + "".join(rows) + '4,"2026/04/14 08:31:00","000","BURNOUT","+   0.00"\n')
    cells = log_cells(path)
    assert cells.header == ("Number [NO.]", "Date&Time", "ms [ms]", "LID [degC]", "ROOM, left [degC]")
    read = read_record(path, {"LID": {"node": "lid"}, "ROOM, left": {"boundary": "room"}})
    assert read["LID"].values[:3] - 273.15 == pytest.approx([20.5, 21.5, 22.5])
    assert read["ROOM, left"].values - 273.15 == pytest.approx([-0.25, -1.25, -2.25, 0.0])
    assert read["LID"].valid.tolist() == [True, True, True, False]


def test_a_table_above_that_names_two_channels_alike_names_none(log):
    head = "CH1,board\nCH2,board\n\ntime,CH1 [degC],CH2 [degC]\n"
    assert log_cells(log(head + "".join(f"{k},2{k}.5,20.5\n" for k in range(5)))).header[1:] == ("CH1 [degC]", "CH2 [degC]")


@pytest.mark.parametrize(
    ("above", "names", "units"),
    [
        ("Logger X1\nEinheit: °C\n", "Time;T1;T2", ("degC", "degC")),
        ("# Unit: °C\n", "Time;T1;T2", ("degC", "degC")),
        ("Device;Foo\nUnit;°C;W\n\n", "t;T1;P", ("degC", "W")),
        ("Unit;°F;mW\n", "t;T1;P", ("degF", "mW")),
        ("Rig 3\nSampling;30 s;Unit;degC\n", "t;T1;T2", ("degC", "degC")),
        ("Unit;°F;mW\n", "t;T1 [°C];P", ("degC", "mW")),
        ("Unit;four;mW\n", "t;T1;P", (None, None)),
    ],
)
def test_units_of_a_line_above_the_header_count(above: str, names: str, units: tuple[str | None, ...]) -> None:
    """They were passed over, and columns whose quantity nobody knew were left out of a joined log."""
    cells = cells_of_text(f"{above}{names}\n" + "".join(f"{t};20.{t};5\n" for t in range(4)), "log.csv", None)
    assert tuple(name_and_unit(name)[1] for name in cells.header[1:]) == units
