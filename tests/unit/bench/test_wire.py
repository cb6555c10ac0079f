"""Lines of the board: what is one, and what is refused with a reason."""

from __future__ import annotations

import pytest
from python_board import made_up_rom

from by_code import raises_code
from thermid.base.errors import RecordError
from thermid.bench._wire import crc8, crc16, parse_line, rom_is_good, sealed, unsealed

ROM = made_up_rom(0)


def test_a_value_is_read() -> None:
    line = parse_line(sealed(f"D,17,12001,{ROM},-198,ok"))
    assert (line.kind, line.number, line.ms, line.raw) == ("D", 17, 12001, -198)


@pytest.mark.parametrize(
    ("body", "match"),
    [
        (f"D,1,2,{ROM},,ok", "'ok'"),
        (f"D,1,2,{ROM},5,lost", "'lost'"),
        (f"D,1,2,{ROM[:-1]}{'0' if ROM[-1] != '0' else '1'},5,ok", "2800003C0B1A0FC0"),
        (f"D,1,2,{ROM},5,fine", "'D,1,2,2800003C0B1A0FCF,5,fine'"),
        (f"D,4294967296,2,{ROM},5,ok", "32"),
        ("B,1,2,uno", "3.*3"),
        (f"S,1,2,{ROM},13", "'2800003C0B1A0FCF,13'"),
        ("", "''"),
        ("\xff\x00", "'ÿ\u0000'"),
    ],
)
def test_a_sealed_line_may_still_be_wrong(body: str, match: str) -> None:
    with raises_code("bench.protocol", RecordError, match=match):
        parse_line(sealed(body))


def test_a_line_without_its_crc_is_none() -> None:
    good = sealed(f"D,17,12001,{ROM},402,ok")
    for at in range(len(good)):
        with pytest.raises(RecordError):
            parse_line(good[:at] + ("0" if good[at] != "0" else "1") + good[at + 1 :])
        with pytest.raises(RecordError):
            parse_line(good[:at])


def test_checks_are_those_of_their_standards() -> None:
    assert crc16("123456789") == "29B1"  # the check value of CRC-16/CCITT-FALSE
    assert crc8(bytes.fromhex("021CB801000000")) == 0xA2  # the example of Maxim's application note 27
    assert rom_is_good("021CB801000000A2")
    assert not rom_is_good("0" * 16)
    assert unsealed(sealed("x")) == "x"
