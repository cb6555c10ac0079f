"""Public files that may not be committed: looked for under the folder named by THERMID_PUBLIC as OWNER/REPOSITORY/path."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest


def public_file(name: str, sha256: str = "") -> Path:
    """Return a public file of this checksum, where one is given; the test is skipped, and names it, where it is absent."""
    file = Path(os.environ.get("THERMID_PUBLIC", "/nowhere")) / name
    if not file.is_file():
        pytest.skip(f"{name} is not under THERMID_PUBLIC")
    if sha256:
        assert hashlib.sha256(file.read_bytes()).hexdigest() == sha256
    return file
