"""The studio's pages are built from the sources, a wheel and an archive of sources carry them, and without them a page says what to do."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import pytest

from thermid.app.studio import server

ROOT = Path(__file__).parents[4]
WEB, BUNDLE = ROOT / "web", ROOT / "src" / "thermid" / "app" / "studio" / "bundle"
PAGES = ("start.html", "start.js", "build.html", "build.js", "studio.html", "studio.js", "pages.css", "plot.css")


def digest() -> str:
    """Return the digest of the sources, as web/build.mjs takes it."""
    names = [*sorted(f"src/{f.name}" for f in (WEB / "src").iterdir()), "build.mjs", "package-lock.json"]
    out = hashlib.sha256()
    for name in names:
        out.update(name.encode() + b"\0" + (WEB / name).read_bytes() + b"\0")
    return out.hexdigest()


def test_the_bundle_is_built_from_the_sources() -> None:
    assert (BUNDLE / "sources.txt").read_text(encoding="utf-8").strip() == digest(), "make setup builds it again"
    assert {*PAGES} <= {f.name for f in BUNDLE.iterdir()}


def test_a_wheel_carries_the_bundle() -> None:
    paths = pytest.importorskip("scikit_build_core.build._pathutil")
    settings = re.search(r"^sdist\.include = \[\"(.+?)\"\]", (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE)
    assert settings is not None
    here = Path.cwd()
    os.chdir(ROOT)
    try:
        files = paths.packages_to_file_mapping(
            packages={"thermid/app/studio": "src/thermid/app/studio"},
            platlib_dir=Path("lib"),
            include=[settings[1]],
            src_exclude=[],
            target_exclude=[],
            build_dir="build",
            mode="default",
        )
    finally:
        os.chdir(here)
    assert {*PAGES} <= {Path(f).name for f in files if "/bundle/" in Path(f).as_posix()}


def test_packages_are_pinned_by_hash_and_without_an_address() -> None:
    lock = (WEB / "package-lock.json").read_text(encoding="utf-8")
    assert "://" not in lock
    assert lock.count('"integrity": "sha512-') == len(re.findall(r'"node_modules/[^"]+": \{', lock))


def test_without_a_bundle_a_page_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(server, "files", lambda package: tmp_path)
    answer = server._file("build.html")
    assert answer.status_code == 503
    assert b"make setup" in bytes(answer.body)


@pytest.mark.campaign
def test_a_wheel_made_of_the_archive_opens_the_studio_without_node(tmp_path: Path) -> None:
    make = "from scikit_build_core.build import build_sdist; import sys; print(build_sdist(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", make, str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    archive = next(tmp_path.glob("*.tar.gz"))
    pip = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", str(tmp_path), str(archive)]
    subprocess.run(pip, check=True, capture_output=True)
    site = tmp_path / "site"
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        wheel.extractall(site)
    program = "import sys; sys.path.insert(0, sys.argv.pop(1)); from thermid.app.cli import main; main()"
    command = [sys.executable, "-c", program, str(site), "studio", "--no-browser"]
    bare = {"PATH": str(tmp_path), "HOME": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=bare) as running:
        try:
            assert running.stdout is not None
            address = running.stdout.readline().split()[1]
            front, _, token = address.partition("?")
            opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
            assert b"/bundle/start.js" in opener.open(address).read()
            assert len(opener.open(f"{front}bundle/build.js?{token}").read()) > 10_000
        finally:
            running.terminate()
