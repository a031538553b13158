"""Create ``.venv-peers`` and install the peers into it: ``python3 benchmarks/peers/install.py``.

A bare ``python3`` runs it; it does nothing when the environment already holds what
``requirements.txt`` asks for.
"""

from __future__ import annotations

import subprocess
import sys
import venv
from pathlib import Path

REQUIREMENTS = Path(__file__).with_name("requirements.txt")
VENV = Path(__file__).resolve().parents[2] / ".venv-peers"
INSTALLED = VENV / ".installed"


def main() -> None:
    """Install, unless the same requirements are installed already."""
    wanted = REQUIREMENTS.read_text()
    if INSTALLED.is_file() and INSTALLED.read_text() == wanted:
        return
    print("== installing Crocoddyl, CasADi and IPOPT into .venv-peers", flush=True)
    venv.create(VENV, clear=True, with_pip=True)
    pip = [VENV / "bin" / "python", "-m", "pip", "install", "--quiet", "--no-deps"]
    code = subprocess.run([*map(str, pip), "-r", str(REQUIREMENTS)]).returncode
    if code:
        sys.exit(code)
    INSTALLED.write_text(wanted)


if __name__ == "__main__":
    main()
