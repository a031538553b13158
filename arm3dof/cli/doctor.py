"""``arm3dof doctor``: is this installation sound, and if not, what is to be done?

This module imports nothing that a broken installation could lack or shadow, rich apart.
"""

from __future__ import annotations

import ctypes.util
import os
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import metadata

from rich.console import Console
from rich.markup import escape

from arm3dof.cli import output

PACKAGES = ("numpy", "pin", "proxsuite", "yourdfpy", "scipy", "meshcat", "starlette")
OPENCV = (
    "opencv-python",
    "opencv-python-headless",
    "opencv-contrib-python",
    "opencv-contrib-python-headless",
)
LIBRARIES = {"libgomp.so.1": "libgomp1", "libGL.so.1": "libgl1"}
MODULES = ("pinocchio", "proxsuite", "cv2")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox", "xdg-open", "open")
VIEWER_PORT = 7000


@dataclass(frozen=True)
class Finding:
    """One line of the doctor's report.

    Attributes:
        what: what was looked at.
        ok: whether arm3dof can work with it.
        found: what was found.
        cure: what to do; empty when nothing has to be done.
    """

    what: str
    ok: bool
    found: str
    cure: str = ""


def examine() -> list[Finding]:
    """Look at Python, the packages, OpenCV, physics, the port, GL and the browser."""
    return [
        _python(),
        *map(_package, PACKAGES),
        *map(_module, MODULES),
        _opencv(),
        _namesake(),
        _robots(),
        _physics(),
        _port(),
        _gl(),
        _browser(),
    ]


def report(*, as_json: bool) -> int:
    """Print every finding; the answer is no when one of them stands in the way."""
    findings = examine()
    sound = all(finding.ok for finding in findings)
    answer = {"ok": sound, "checks": [asdict(finding) for finding in findings]}

    def show(console: Console) -> None:
        for line in _lines(findings):
            console.print(line)
        console.print("[green]all is well[/]" if sound else "[red]see the arrows above[/]")

    return output.deliver(answer, as_json=as_json, show=show, yes=sound)


def explain(error: ImportError) -> None:
    """Say on stderr why arm3dof cannot start: the failed import, and every finding that is bad."""
    console = output.err()
    console.print(f"error: {error}", markup=False)
    for line in _lines([finding for finding in examine() if not finding.ok]):
        console.print(line)


def _lines(findings: list[Finding]) -> Iterator[str]:
    width = max((len(finding.what) for finding in findings), default=0)
    for finding in findings:
        mark = "[green]ok[/]" if finding.ok else "[red]no[/]"
        yield f"{mark}  {finding.what:{width}}  [dim]{escape(finding.found)}[/]"
        if finding.cure:
            yield f"    {'':{width}}  -> {escape(finding.cure)}"


def _python() -> Finding:
    ok = sys.version_info >= (3, 11)
    version = ".".join(map(str, sys.version_info[:3]))
    where = "in a virtual environment" if sys.prefix != sys.base_prefix else "not in a venv"
    cure = "" if ok else "arm3dof needs Python 3.11 or newer: make PYTHON=python3.11 demo"
    return Finding("python", ok, f"{version}, {where}", cure)


def _package(name: str) -> Finding:
    try:
        return Finding(name, ok=True, found=metadata.version(name))
    except metadata.PackageNotFoundError:
        return Finding(name, ok=False, found="not installed", cure=f"pip install {name}")


def _module(name: str) -> Finding:
    """Import a compiled module in its own process: a wrong binary may crash it."""
    code = f"import {name}; print({name}.__file__)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    what = f"import {name}"
    if run.returncode:
        reason = (run.stderr.strip().splitlines() or [f"exit code {run.returncode}"])[-1]
        cure = _shadow_cure() or _library_cure(reason) or "reinstall arm3dof"
        return Finding(what, ok=False, found=reason, cure=cure)
    path = run.stdout.strip()
    if path.startswith(sys.prefix):
        return Finding(what, ok=True, found=path)
    cure = _shadow_cure() or f"this copy is outside {sys.prefix}: install arm3dof in a venv"
    return Finding(what, ok=False, found=f"shadowed by {path}", cure=cure)


def _library_cure(reason: str) -> str:
    missing = re.search(r"(lib\S+): cannot open shared object file", reason)
    if missing is None:
        return ""
    package = LIBRARIES.get(missing[1], missing[1])
    return f"install the system's {package} (Debian and Ubuntu: sudo apt-get install {package})"


def _shadow_cure() -> str:
    shadows = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    if not shadows:
        return ""
    ros = " (a ROS setup script sets it)" if any("/ros/" in path for path in shadows) else ""
    return f"PYTHONPATH={os.pathsep.join(shadows)} comes before this environment{ros}: unset it"


def _opencv() -> Finding:
    found = [name for name in OPENCV if _package(name).ok]
    if len(found) == 1:
        return Finding("one opencv", ok=True, found=f"{found[0]} {metadata.version(found[0])}")
    if not found:
        cure = "pip install opencv-python-headless"
        return Finding("one opencv", ok=False, found="none", cure=cure)
    keep = found[0]
    cure = f"they overwrite each other: pip uninstall -y {' '.join(found)} && pip install {keep}"
    return Finding("one opencv", ok=False, found=", ".join(found), cure=cure)


def _namesake() -> Finding:
    """The package called 'pinocchio' on the registry is not the robotics library ('pin' is)."""
    what = "no namesake"
    if not _package("pinocchio").ok:
        return Finding(what, ok=True, found="the library comes from the package 'pin'")
    cure = "it is not the robotics library: pip uninstall -y pinocchio, then reinstall pin"
    return Finding(what, ok=False, found="a package called 'pinocchio'", cure=cure)


def _robots() -> Finding:
    what = "more robots"
    if (data := _package("example-robot-data")).ok:
        return Finding(what, ok=True, found=f"example-robot-data {data.found}")
    cure = "for ur5, panda, so101 and others (optional, 420 MB): pip install 'arm3dof[robots]'"
    return Finding(what, ok=True, found="the bundled arm only", cure=cure)


def _physics() -> Finding:
    """Make a renderer in a process of its own: a driver may crash it."""
    what = "physics world"
    if not (package := _package("mujoco")).ok:
        cure = "for grasping and sorting in physics (optional): pip install 'arm3dof[physics]'"
        return Finding(what, ok=True, found="not installed", cure=cure)
    code = "from arm3dof.sim.renderer import backend; print(backend()[0])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if run.returncode == 0:
        return Finding(
            what, ok=True, found=f"mujoco {package.found}, draws by {run.stdout.strip()}"
        )
    reason = (run.stderr.strip().splitlines() or [f"exit code {run.returncode}"])[-1]
    cure = "no pictures of it: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0"
    return Finding(what, ok=True, found=f"mujoco {package.found}; {reason}", cure=cure)


def _port() -> Finding:
    what = f"port {VIEWER_PORT}"
    with socket.socket() as probe:
        if probe.connect_ex(("127.0.0.1", VIEWER_PORT)) != 0:
            return Finding(what, ok=True, found="free")
    cure = "another program listens there; the viewer takes the next free port"
    return Finding(what, ok=True, found="taken", cure=cure)


def _gl() -> Finding:
    what = "graphics"
    libraries = [name for name in ("EGL", "OSMesa", "GL") if ctypes.util.find_library(name)]
    if libraries:
        return Finding(what, ok=True, found=", ".join(f"lib{name}" for name in libraries))
    cure = "only rendering without a browser needs it (Debian: apt-get install libegl1)"
    return Finding(what, ok=True, found="no GL library", cure=cure)


def _browser() -> Finding:
    for name in BROWSERS:
        if path := shutil.which(name):
            return Finding("browser", ok=True, found=path)
    cure = "the pages are plain HTML: open the printed address on any machine that has one"
    return Finding("browser", ok=True, found="none found", cure=cure)
