"""The seal at the end of a file that thermid wrote: its kind, and a checksum of what stands before it. Decision 109 says why."""

from __future__ import annotations

import hashlib
import re
import struct
import zlib
from pathlib import Path
from typing import Final

_END: Final = rb'(?:\s*|\s*-->\s*|"\s*\}\s*|.{4}\0\0\0\0IEND\xaeB`\x82)\Z'
"""What may stand after a seal: the end of a line, of a comment, of a JSON object, of a PNG."""


def seal(data: bytes, name: str, comment: bytes = b"#") -> bytes:
    """Return a file with its seal at the end, as a comment of its language."""
    if data.startswith(b"\x89PNG"):
        end = data[-12:]
        front = data[:-12] + struct.pack(">I", len(b"Software\0" + _words(name, b""))) + b"tEXtSoftware\0"
        words = _words(name, front)
        return front + words + struct.pack(">I", zlib.crc32(b"tEXtSoftware\0" + words)) + end
    if data.startswith(b"%PDF-"):
        front, back = data.rstrip(b"\n") + b"\n% ", b"\n"
    elif data.lstrip()[:1] == b"<":
        front, back = data.rstrip() + b"\n<!-- ", b" -->\n"
    elif data.lstrip()[:1] == b"{":
        front, back = data.rstrip()[:-1].rstrip() + b',\n "seal": "', b'"\n}\n'
    else:
        front, back = data + (b"" if data.endswith(b"\n") else b"\n") + comment + b" ", b"\n"
    return front + _words(name, front) + back


def _words(name: str, before: bytes) -> bytes:
    """Return the words of a seal: who wrote what, and the checksum of what stands before them, whatever the line ends."""
    digest = hashlib.sha256(before.replace(b"\r\n", b"\n")).hexdigest()[:16]
    return f"written by thermid: {name}, sha256 {digest}".encode()


def sealed(path: Path, name: str) -> bool:
    """Whether a file carries the seal of a kind, and is what it was when it got it."""
    data = path.read_bytes()
    at = data.rfind(b"written by thermid: ")
    words = _words(name, data[: max(at, 0)])
    return at >= 0 and re.match(re.escape(words) + _END, data[at:], re.DOTALL) is not None


def unsealed(text: str) -> str:
    """Return the text of a TOML file without its seal."""
    return re.sub(r"^# written by thermid: [\w ]+, sha256 [0-9a-f]{16}\s*\Z", "", text, flags=re.MULTILINE)
