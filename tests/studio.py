"""The studio as a program of its own, for the tests that visit it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PATIENCE = 240  # s
PROGRAM = "import sys; from arm3dof.cli import main; sys.exit(main())"


@dataclass
class Program:
    """A studio that runs."""

    url: str
    port: int
    out: Path
    pid: int


@contextmanager
def studio(out: Path, *options: str) -> Iterator[Program]:
    """Run the studio, press Ctrl-C at the end, and see that it ends cleanly."""
    words = ["studio", "--json", "--no-browser", "--out", str(out), "--port", "0", *options]
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import sys; from arm3dof.cli import main; sys.exit(main())",
            *words,
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        text = ""
        for line in process.stdout:
            text += line
            if line == "}\n":
                break
        assert text, process.communicate(timeout=PATIENCE)[1]
        answer = json.loads(text)
        port = int(answer["url"].rsplit(":", 1)[1].strip("/"))
        yield Program(answer["url"], port, out, process.pid)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, errors
        assert errors == "stopped\n", errors
    finally:
        process.kill()
        process.communicate()
