"""Small logs in the layouts that their makers publish, with what stands in them written down beside."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Sample:
    """One log: its bytes, and what must be read from it with no option.

    `expected` holds name -> (first value, last value) in SI of columns read under their own names; `times` the first, second and last time.
    A log that must be refused has the words of its message and the option that reads it instead.
    """

    file: str
    data: bytes
    format: str
    times: tuple[float, float, float]
    expected: dict[str, tuple[float, float]]
    start: str | None = None
    roles: dict[str, dict[str, str]] = field(default_factory=dict)
    refused: str = ""
    remedy: dict[str, Any] = field(default_factory=dict)
    needs: str = ""


SAMPLES: list[Callable[[], Sample]] = []
ICE = 273.15


def sample(make: Callable[[], Sample]) -> Callable[[], Sample]:
    SAMPLES.append(make)
    return make


@sample
def keysight_34970a() -> Sample:
    text = (
        "Scan,Time,101 (C),Alarm 101,102 (C),Alarm 102,201 (VDC),Alarm 201\n"
        "1,01/26/2009 08:07:12:237,22.480,0,22.510,0,11.998,0\n2,01/26/2009 08:07:22:237,22.750,0,22.530,0,11.997,0\n"
        "3,01/26/2009 08:07:32:238,23.115,0,22.560,0,11.998,0\n"
    )
    expected = {"101": (22.48 + ICE, 23.115 + ICE), "102": (22.51 + ICE, 22.56 + ICE), "201": (11.998, 11.998)}
    return Sample("34970A.csv", text.encode(), "text", (0, 10, 20.001), expected, "01/26/2009 08:07:12:237")


@sample
def benchlink() -> Sample:
    text = (
        "Name:,Chamber run\nAcquisition Date:,4/21/2026 1:39:54 PM\nOwner:,lab\nComments:,\nInstrument:,34970A,Address:,GPIB0::9::INSTR\n"
        "Total Channels:,2\nChannel,Name,Function,Range,Resolution,Advanced Settings,Scale,Gain,Offset,Label\n"
        "101,case,Temp (Type K),C,5.5,Reference=INT,False,1,0,C\n102,air,Temp (Type K),C,5.5,Reference=INT,False,1,0,C\n\n"
        "Scan Control:\nStart Action:,Immediately\nScan Interval:,30 Secs\n\n"
        "Scan,Time,101 <case> (C),Alarm 101,102 <air> (C),Alarm 102\n"
        + "".join(f"{k + 1},04/21/2026 13:{39 + k // 2}:{24 + 30 * (k % 2)}:117,{21 + k / 4:.3f},0,{20.5:.3f},0\n" for k in range(8))
    )
    expected = {"case": (21.0 + ICE, 22.75 + ICE), "air": (20.5 + ICE, 20.5 + ICE)}
    data = text.replace("\n", "\r\n").encode("utf-16")
    return Sample("benchlink.csv", data, "text", (0, 30, 210), expected, "04/21/2026 13:39:24:117")


@sample
def benchvue() -> Sample:
    text = (
        "Address,USB0::0x2A8D::0x5101::MY58000000::0::INSTR\nModel,DAQ970A\nScan Interval,00:00:10\n\n"
        "Scan Sweep Time (Sec),Scan Number,101 (Cel)- plate,102 (Vdc)- shunt\n"
        "2020-02-21 13:41:31.610,1,40.125,0.0501\n2020-02-21 13:41:41.610,2,40.250,0.0502\n2020-02-21 13:41:51.610,3,40.500,0.0503\n"
    )
    expected = {"shunt": (0.0501, 0.0503)}
    return Sample("DAQ970A.csv", text.encode(), "text", (0, 10, 20), expected, "2020-02-21 13:41:31.610")


@sample
def picolog() -> Sample:
    text = '"","TC-08 1 Ave. (°C)","TC-08 2 Ave. (°C)"\r\n"2024-05-03T10:00:00+01:00","21.50","20.10"\r\n' + "".join(
        f'"2024-05-03T10:0{k}:00+01:00","{21.5 + k:.2f}","20.{10 + k}"\r\n' for k in range(1, 4)
    )
    expected = {"TC-08 1 Ave.": (21.5 + ICE, 24.5 + ICE), "TC-08 2 Ave.": (20.1 + ICE, 20.13 + ICE)}
    return Sample("picolog6.csv", text.encode(), "text", (0, 60, 180), expected, "2024-05-03T10:00:00+01:00")


LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t{sign}\nMulti_Headings\tNo\n"
    "X_Columns\t{x}\nTime_Pref\tAbsolute\nOperator\tlab\nDate\t2024/03/05\nTime\t09:58:00{sign}25\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t4\t4\t\nDate\t2024/03/05\t2024/03/05\t\nTime\t10:00:00{sign}5\t10:00:00{sign}5\t\n"
    "Y_Unit_Label\tDeg C\tWatts\t\nX_Dimension\tTime\tTime\t\nX0\t0{sign}0E+0\t0{sign}0E+0\t\nDelta_X\t1{sign}000000\t1{sign}000000\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tcase\theater\tComment\n"
)


@sample
def labview_decimal_comma_without_x() -> Sample:
    text = LVM.format(sign=",", x="No") + "".join(f"\t{21 + k},250000\t4,100000\n" for k in range(4))
    expected = {"case": (21.25 + ICE, 24.25 + ICE), "heater": (4.1, 4.1)}
    roles = {"heater": {"load": "heater"}}
    return Sample("procsisnav.lvm", text.encode(), "LabVIEW measurement", (0, 1, 3), expected, "2024-03-05T10:00:00.500000", roles)


@sample
def labview_with_x() -> Sample:
    text = LVM.format(sign=".", x="One") + "".join(f"{k * 2.5:.6f}\t{21 + k}.5\t4.1\n" for k in range(4))
    return Sample("x.lvm", text.encode(), "LabVIEW measurement", (0, 2.5, 7.5), {"case": (21.5 + ICE, 24.5 + ICE)})


@sample
def serial_capture() -> Sample:
    text = (
        "12:01:30.051 -> ProcSISNAV bench, firmware 1.3\n12:01:30.104 -> 2 DS18B20 found\n12:01:31.000 -> T1,T2\n"
        "12:01:32.000 -> 23.50,22.06\n12:01:33.000 -> 23.56,22.06\n12:01:33.412 -> watchdog ok\n12:01:34.000 -> 23.69,22.12\n"
    )
    expected = {"T1": (23.5 + ICE, 23.69 + ICE), "T2": (22.06 + ICE, 22.12 + ICE)}
    return Sample("capture.txt", text.encode(), "serial capture", (0, 1, 2), expected, "12:01:32.000")


@sample
def serial_capture_with_names() -> Sample:
    text = "23:59:58.500 -> ready\n" + "".join(
        f"{s} -> case: {23 + k / 2:.2f} °C  air: 71.60 °F  P = 950 mW\n"
        for k, s in enumerate(("23:59:59.000", "00:00:00.000", "00:00:01.500"))
    )
    expected = {"case": (23.0 + ICE, 24.0 + ICE), "air": (22.0 + ICE, 22.0 + ICE), "P": (0.95, 0.95)}
    return Sample("names.txt", text.encode(), "serial capture", (0, 1, 2.5), expected, "23:59:59.000")


@sample
def sketch_with_banner() -> Sample:
    text = "DS18B20 logger v1.2\nfound 2 devices\nms,T1_degC,T2_degF\n1000,21.50,71.6\n2000,21.56,71.6\n3500,21.62,73.4\n"
    return Sample("sketch.csv", text.encode(), "text", (1, 2, 3.5), {"T1_degC": (21.5 + ICE, 21.62 + ICE), "T2_degF": (22 + ICE, 23 + ICE)})


def epoch(name: str, factor: int) -> Callable[[], Sample]:
    def make() -> Sample:
        stamps = [int(1_700_000_000.5 * factor) + int(k * 10 * factor) for k in range(4)]
        text = "time,T1\n" + "".join(f"{t},{20 + k}\n" for k, t in enumerate(stamps))
        start = "2023-11-14T22:13:20.500000+00:00" if factor > 1 else "2023-11-14T22:13:20+00:00"
        return Sample(f"epoch_{name}.csv", text.encode(), "text", (0, 10, 30), {"T1": (20 + ICE, 23 + ICE)}, start)

    make.__name__ = f"epoch_{name}"
    return make


for unit_name, per_second in (("s", 1), ("ms", 1000), ("us", 1_000_000), ("ns", 1_000_000_000)):
    sample(epoch(unit_name, per_second))


@sample
def am_pm_month_first() -> Sample:
    rows = [("02/28/2024", "11:59:30 PM"), ("02/29/2024", "12:00:30 AM"), ("02/29/2024", "12:01:30 AM"), ("03/01/2024", "1:00:30 PM")]
    text = "Date,Time,Plate (°F)\n" + "".join(f"{d},{t},{68 + k}\n" for k, (d, t) in enumerate(rows))
    expected = {"Plate": (293.15, 293.15 + 3 / 1.8)}
    return Sample("ampm.csv", text.encode(), "text", (0, 60, 86400 + 13 * 3600 + 60), expected, "02/28/2024 11:59:30 PM")


@sample
def brazilian_sheet() -> Sample:
    text = "Data;Hora;T carcaça (°C);Potência (mW)\n13/03/2024;23:59:50;24,5;2000\n14/03/2024;00:00:00;24,75;2000\n"
    text += "14/03/2024;00:00:10;25,0;2000\n"
    expected = {"T carcaça": (24.5 + ICE, 25 + ICE), "Potência": (2.0, 2.0)}
    return Sample("planilha.csv", text.encode("latin-1"), "text", (0, 10, 20), expected, "13/03/2024 23:59:50", {"Potência": {"load": "q"}})


@sample
def day_or_month() -> Sample:
    text = "time,T1\n05/06/2024 10:00,20\n06/06/2024 10:00,21\n08/06/2024 10:00,22\n"
    remedy = {"clock": "%d/%m/%Y %H:%M"}
    return Sample(
        "dates.csv", text.encode(), "text", (0, 86400, 3 * 86400), {"T1": (20 + ICE, 22 + ICE)}, refused="both fit", remedy=remedy
    )


@sample
def unit_that_nobody_knows() -> Sample:
    text = "time,T1 (left)\n0,20\n1,21\n2,22\n"
    words = r"'\[left\]' is not a known unit"
    return Sample(
        "left.csv", text.encode(), "text", (0, 1, 2), {"T1": (20 + ICE, 22 + ICE)}, refused=words, remedy={"units": {"T1": "degC"}}
    )


@sample
def home_assistant() -> Sample:
    text = "entity_id,state,last_changed\n" + "".join(
        f"sensor.case_temperature,{21 + k / 4},2024-02-01T00:0{k}:00.000Z\n" for k in range(5)
    )
    text += "sensor.air_temperature,20.5,2024-02-01T00:00:00.000Z\nsensor.air_temperature,unavailable,2024-02-01T00:01:00.000Z\n"
    text += "sensor.air_temperature,20.75,2024-02-01T00:04:00.000Z\n"
    expected = {"sensor.case_temperature": (21 + ICE, 22 + ICE), "sensor.air_temperature": (20.5 + ICE, 20.75 + ICE)}
    return Sample("history.csv", text.encode(), "long table", (0, 60, 240), expected, "2024-02-01T00:00:00.000Z")


@sample
def influxdb() -> Sample:
    head = "#datatype,string,long,dateTime:RFC3339,double,string,string,string\n#group,false,false,false,false,true,true,true\n"
    head += "#default,_result,,,,,,\n,result,table,_time,_value,_field,_measurement,sensor\n"
    rows = [
        f",,{n},2024-02-01T00:00:{10 * k:02d}Z,{20 + n + k},temperature,lab,{s}\n" for n, s in enumerate(("case", "air")) for k in range(3)
    ]
    expected = {"temperature case": (20 + ICE, 22 + ICE), "temperature air": (21 + ICE, 23 + ICE)}
    return Sample("influx.csv", (head + "".join(rows)).encode(), "InfluxDB annotated CSV", (0, 10, 20), expected, "2024-02-01T00:00:00Z")


@sample
def grafana() -> Sample:
    text = '"Time","case","heater"\n2024-02-01 00:00:00,24.0 °C,950 mW\n2024-02-01 00:00:30,24.5 °C,1.20 W\n'
    text += "2024-02-01 00:01:00,25.0 °C,1.20 W\n"
    expected = {"case": (24 + ICE, 25 + ICE), "heater": (0.95, 1.2)}
    return Sample("grafana.csv", text.encode(), "text", (0, 30, 60), expected, "2024-02-01 00:00:00", {"heater": {"load": "q"}})


@sample
def grafana_series_to_rows() -> Sample:
    rows = [f'"{s}",{1706745600000 + 30000 * k},{v + k} °C\n' for s, v in (("case", 24), ("air", 20)) for k in range(3)]
    text = '"Series","Time","Value"\n' + "".join(rows)
    expected = {"case": (24 + ICE, 26 + ICE), "air": (20 + ICE, 22 + ICE)}
    return Sample("rows.csv", text.encode(), "long table", (0, 30, 60), expected, "2024-02-01T00:00:00+00:00")


@sample
def hobo() -> Sample:
    head = '\ufeff"Plot Title: shelf"\n"#","Date Time, GMT-05:00","Temp, °F (LGR S/N: 1, SEN S/N: 2, LBL: shelf)","Stopped (LGR S/N: 1)"\n'
    text = (
        head + "1,05/31/18 11:45:00 PM,68.0,\n2,06/01/18 12:00:00 AM,69.8,\n3,06/01/18 12:15:00 AM,71.6,\n4,06/01/18 12:15:06 AM,,Logged\n"
    )
    return Sample("hobo.csv", text.encode(), "text", (0, 900, 1806), {"Temp shelf": (293.15, 295.15)}, "05/31/18 11:45:00 PM")


@sample
def campbell_toa5() -> Sample:
    text = (
        '"TOA5","lab","CR1000","1","CR1000.Std.30","CPU:x.cr1","1","T"\n"TIMESTAMP","RECORD","T_case_Avg","Batt_V"\n'
        '"TS","RN","Deg C","Volts"\n'
        '"","","Avg","Smp"\n"2023-08-01 15:00:00",1,26.5,12.5\n"2023-08-01 15:01:00",2,26.75,12.5\n"2023-08-01 15:02:00",3,"NAN",12.4\n'
        '"2023-08-01 15:03:00",4,27.0,12.4\n'
    )
    expected = {"T_case_Avg": (26.5 + ICE, 27 + ICE), "Batt_V": (12.5, 12.4)}
    return Sample("toa5.dat", text.encode(), "text", (0, 60, 180), expected, "2023-08-01 15:00:00")


@sample
def per_cent_for_watts() -> Sample:
    text = "time [s],T1 [degC],heater (%)\n0,20,50\n10,21,50\n20,22,0\n"
    roles = {"heater": {"load": "q"}}
    expected = {"T1": (20 + ICE, 22 + ICE), "heater": (2.0, 0.0)}
    remedy = {"full_scale": "4 [W]"}
    return Sample("duty.csv", text.encode(), "text", (0, 10, 20), expected, None, roles, "a load needs watts. Give full_scale", remedy)


@sample
def tdms() -> Sample:
    from nptdms import ChannelObject, TdmsWriter

    out = io.BytesIO()
    wave = {"wf_increment": 0.5, "wf_start_offset": 0.0, "wf_start_time": np.datetime64("2024-05-01T10:00:00", "us"), "wf_samples": 4}
    with TdmsWriter(out) as writer:
        first = ChannelObject("run", "case", np.array([21.0, 21.5, 22.0, 22.5]), wave | {"unit_string": "Deg C"})
        writer.write_segment([first, ChannelObject("run", "heater", np.full(4, 4.1), wave | {"unit_string": "W"})])
    expected = {"case": (21 + ICE, 22.5 + ICE), "heater": (4.1, 4.1)}
    return Sample("run.tdms", out.getvalue(), "NI TDMS", (0, 0.5, 1.5), expected, "2024-05-01T10:00:00", needs="nptdms")


@sample
def matlab_structure() -> Sample:
    from scipy.io import savemat

    out = io.BytesIO()
    savemat(out, {"t": np.arange(5.0) * 2, "T_case": np.arange(5.0) + 20, "T": np.c_[np.arange(5.0) + 30, np.arange(5.0) + 40], "k": 3.0})
    expected = {"T_case": (20 + ICE, 24 + ICE), "T_1": (30 + ICE, 34 + ICE), "T_2": (40 + ICE, 44 + ICE)}
    return Sample("log.mat", out.getvalue(), "MATLAB", (0, 2, 8), expected)


@sample
def simulink_log() -> Sample:
    from scipy.io import savemat

    out = io.BytesIO()
    days = 738946.5 + np.arange(4) / 86400 * 10
    savemat(out, {"ans": {"time": days, "signals": {"values": np.arange(4.0) + 20, "label": "case"}}})
    return Sample("simulink.mat", out.getvalue(), "MATLAB", (0, 10, 30), {"case": (20 + ICE, 23 + ICE)}, "2023-03-01T12:00:00")


@sample
def hdf5() -> Sample:
    import h5py

    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        file["run/time"] = np.arange(4) * 5.0
        file["run/time"].attrs["units"] = "s"
        file["run/case"] = np.array([68.0, 69.8, 71.6, 73.4])
        file["run/case"].attrs["units"] = "degF"
    return Sample("log.h5", out.getvalue(), "HDF5", (0, 5, 15), {"run/case": (293.15, 296.15)}, needs="h5py")


@sample
def netcdf_classic() -> Sample:
    from scipy.io import netcdf_file

    out = io.BytesIO()
    file = netcdf_file(out, "w")
    file.createDimension("time", 3)
    for name, kind, units, values in (
        ("time", "i4", "minutes since 2024-05-01 10:00:00", [30, 31, 33]),
        ("case", "f8", "K", [300.0, 301.0, 302.5]),
    ):
        variable = file.createVariable(name, kind, ("time",))
        variable[:] = values
        variable.units = units
    file.flush()
    return Sample("log.nc", out.getvalue(), "netCDF classic", (0, 60, 180), {"case": (300.0, 302.5)}, "2024-05-01T10:30:00")


def cells_of_sheet(rows: list[list[Any]]) -> str:
    out = []
    for r, row in enumerate(rows, 1):
        cells = []
        for c, value in enumerate(row):
            at = f"{chr(65 + c)}{r}"
            if isinstance(value, str):
                cells.append(f'<c r="{at}" t="inlineStr"><is><t>{value}</t></is></c>')
            else:
                style = ' s="1"' if c == 0 else ""
                cells.append(f'<c r="{at}"{style}><v>{value!r}</v></c>')
        out.append(f'<row r="{r}">{"".join(cells)}</row>')
    return "".join(out)


@sample
def excel() -> Sample:
    """A workbook as Office Open XML lays it out; days since 1900 with a format of date and time."""
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    rel = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    kinds = "http://schemas.openxmlformats.org/package/2006"
    rows = [["Ensaio 12"], ["Data/Hora", "T carcaça", "P"], ["", "°C", "mW"]]
    rows += [[45413.5 + k * 10 / 86400, 24.5 + k, 2000] for k in range(4)]
    office = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{kinds}/content-types"><Default Extension="rels" '
        f'ContentType="application/vnd.openxmlformats-'
        f'package.relationships+xml"/><Default Extension="xml" ContentType="application/xml"/><Override PartName="/xl/workbook.xml" '
        f'ContentType="{office}.sheet.main+xml"/><Override PartName="/xl/worksheets/sheet1.xml" ContentType="{office}.worksheet+xml"/>'
        f'<Override PartName="/xl/styles.xml" ContentType="{office}.styles+xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{kinds}/relationships"><Relationship Id="r1" Type="{rel}/officeDocument" '
        'Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{rel}"><sheets><sheet name="dados" sheetId="1" r:id="r1"/></sheets>'
        "</workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{kinds}/relationships"><Relationship Id="r1" Type="{rel}/worksheet" '
        f'Target="worksheets/sheet1.xml"/><Relationship Id="r2" Type="{rel}/styles" Target="styles.xml"/></Relationships>',
        "xl/styles.xml": f'<styleSheet xmlns="{main}"><cellXfs count="2"><xf numFmtId="0"/><xf numFmtId="22"/></cellXfs></styleSheet>',
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{main}"><sheetData>{cells_of_sheet(rows)}</sheetData></worksheet>',
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        for name, text in parts.items():
            file.writestr(name, '<?xml version="1.0" encoding="UTF-8"?>\n' + text)
    expected = {"T carcaça": (24.5 + ICE, 27.5 + ICE), "P": (2.0, 2.0)}
    roles = {"P": {"load": "q"}}
    return Sample("ensaio.xlsx", out.getvalue(), "workbook", (0, 10, 30), expected, "2024-05-01T12:00:00", roles, needs="python_calamine")


@sample
def two_lines_of_names() -> Sample:
    text = "CH1;CH2;CH3;CH4\nZeit;Gehäuse;Luft;Heizung\ns;°C;°C;mW\n" + "".join(
        f"{30 * k};{20 + k},5;20,5;{2000 * (k > 1)}\n" for k in range(5)
    )
    expected = {"Gehäuse": (20.5 + ICE, 24.5 + ICE), "Luft": (20.5 + ICE, 20.5 + ICE), "Heizung": (0.0, 2.0)}
    roles = {"Heizung": {"load": "q"}, "Gehäuse": {"node": "a"}, "Luft": {"boundary": "b"}}
    return Sample("kanal.csv", text.encode(), "text", (0, 30, 120), expected, None, roles)


@sample
def bench_log() -> Sample:
    """Lines as the logger of the bench writes them: reception and board times, one sensor in sixteenths of a degree."""
    from thermid.bench._wire import crc16
    from thermid.bench.benchlog import log_line

    rom, lines = "2800003C0B1A0FCF", ["# thermid bench log 1\n"]
    for k in range(5):
        body = f"D,{k},{1000 * k + 87},{rom},{320 + k},ok"
        lines.append(log_line(f"1 {k + 0.004:.6f} {body}*{crc16(body)}"))
    data, roles = "".join(lines).encode(), {rom: {"node": "a"}}
    return Sample("bench.log", data, "bench log", (0, 1, 4), {rom: (20 + ICE, 20.25 + ICE)}, None, roles)


@sample
def matlab_7_3() -> Sample:
    """HDF5 behind 512 bytes that name MATLAB, as its version 7.3 saves."""
    import h5py

    out = io.BytesIO()
    with h5py.File(out, "w", userblock_size=512) as file:
        file["t"] = np.arange(4.0)[None, :] * 5
        file["T_case"] = np.arange(4.0)[None, :] + 20
    data = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + out.getvalue()[512:]
    return Sample("log73.mat", data, "MATLAB 7.3", (0, 5, 15), {"T_case": (20 + ICE, 23 + ICE)}, needs="h5py")


@sample
def old_excel() -> Sample:
    """A sheet of texts and numbers in BIFF 8, in a compound file of one stream."""

    def record(kind: int, form: str, *values: Any) -> bytes:
        body = struct.pack("<" + form, *values)
        return struct.pack("<HH", kind, len(body)) + body

    def begin(kind: int) -> bytes:
        return record(0x0809, "HHHHII", 0x0600, kind, 0, 1997, 0, 0x0600)

    names = ("time [s]", "case [degC]")
    cells = [record(0x0204, f"HHHHB{len(name)}s", 0, k, 0, len(name), 0, name.encode()) for k, name in enumerate(names)]
    cells += [record(0x0203, "HHHd", row, k, 0, value) for row in range(1, 5) for k, value in enumerate((10.0 * row, 20.5 + row))]
    end = record(0x000A, "")
    top = len(begin(5)) + len(record(0x0085, "IBBBB3s", 0, 0, 0, 3, 0, b"log")) + len(end)
    stream = begin(5) + record(0x0085, "IBBBB3s", top, 0, 0, 3, 0, b"log") + end + begin(0x10) + b"".join(cells) + end
    sectors, free, last = 8, 0xFFFFFFFF, 0xFFFFFFFE
    chain = [0xFFFFFFFD, last, *range(3, 2 + sectors), last]

    def entry(name: str, kind: int, child: int, start: int, size: int) -> bytes:
        text = name.encode("utf-16-le")
        size_of_name = len(text) + 2 if text else 0
        return struct.pack("<64sHBBIII36sIQ", text, size_of_name, kind, 1, free, free, child, b"", start, size)

    folder = entry("Root Entry", 5, 1, last, 0) + entry("Workbook", 2, free, 2, 512 * sectors) + entry("", 0, free, 0, 0) * 2
    head = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(16) + struct.pack("<HHHHH6s", 0x3E, 3, 0xFFFE, 9, 6, b"")
    head += struct.pack("<9I", 0, 1, 1, 0, 4096, last, 0, last, 0) + struct.pack("<109I", 0, *[free] * 108)
    table = struct.pack("<128I", *chain, *[free] * (128 - len(chain)))
    data = head + table + folder + stream.ljust(512 * sectors, b"\0")
    return Sample(
        "log.xls",
        data,
        "workbook",
        (10, 20, 40),
        {"case": (21.5 + ICE, 24.5 + ICE)},
        None,
        {"case": {"node": "a"}},
        needs="python_calamine",
    )
