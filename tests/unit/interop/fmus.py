"""FMUs of tests: a box of two nodes, and Reference-FMUs of the Modelica Association compiled here."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest

BOX: dict[str, Any] = {
    "title": "box",
    "needs": ["air"],
    "parameters": {"g": "0.8 [W/K]", "c": "50 [J/K]", "power": "5 [W]"},
    "nodes": {"a": {"capacitance": "c"}, "b": {"capacitance": "90 [J/K]"}},
    "conductors": {
        "ab": {"kind": "conduction", "between": ["a", "b"], "conductance": "g"},
        "out": {"kind": "conduction", "between": ["b", "air"], "conductance": "0.5 [W/K]"},
    },
    "loads": {"heat": {"into": "a", "power": "power"}},
}

SHA256 = {
    "src/fmi3Functions.c": "d7f76396fc85483d917440575c684ea959f6ee56f2d56e699cfaf81c2d0ac919",
    "src/cosimulation.c": "85eae5983fd4bc80877523fd6b4df8928321505bd9442819ea247d840341c5e6",
    "VanDerPol/model.c": "89305fea3c1d3a00974333597e8f11686900826285a1aabf7ce9178a03e7405b",
    "Dahlquist/model.c": "03a9c8be25b831cece9456f2c25fa576674f12c069c291fba2fdc56bfbeba820",
    "VanDerPol/FMI3.xml": "5cf6b636526dff628c6f9492e333b65d9850ee4737e37705409d1b88585bcec6",
    "Dahlquist/FMI3.xml": "c5411c49e51c73be8566cee2217472368815f9e5cb1ae9b81f56f08104cb1b9d",
}


def reference_fmu(name: str, folder: Path) -> Path:
    """Compile a Reference-FMU from its sources: an FMU that thermid knows nothing of."""
    root = Path(os.environ.get("THERMID_PUBLIC", "/nowhere")) / "modelica" / "Reference-FMUs"
    if not (root / name).is_dir() or shutil.which("cc") is None:
        pytest.skip("modelica/Reference-FMUs is not under THERMID_PUBLIC, or there is no C compiler")
    for file in ("src/fmi3Functions.c", "src/cosimulation.c", f"{name}/model.c", f"{name}/FMI3.xml"):
        assert hashlib.sha256((root / file).read_bytes()).hexdigest() == SHA256[file]
    library = folder / f"{name}.so"
    files = [root / "src" / "fmi3Functions.c", root / "src" / "cosimulation.c", root / name / "model.c"]
    flags = ["-DFMI_VERSION=3", "-DDISABLE_PREFIX", f'-DMODEL_IDENTIFIER="{name}"', f"-I{root / 'include'}", f"-I{root / name}"]
    subprocess.run(["cc", "-shared", "-fPIC", "-w", *flags, "-o", library, *files, "-lm"], check=True)
    packed_file = folder / f"{name}.fmu"
    with zipfile.ZipFile(packed_file, "w") as packed:
        packed.write(root / name / "FMI3.xml", "modelDescription.xml")
        packed.write(library, f"binaries/x86_64-linux/{name}.so")
    return packed_file
