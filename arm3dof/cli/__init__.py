"""The command line: read the arguments, call the library, print the answer.

Every command takes ``--json`` and ends with exit code 0 (done), 1 (the answer is no) or 2 (bad
input, one line on stderr).
"""

from __future__ import annotations

import os
import sys

from arm3dof.cli import doctor

__all__ = ["main"]


def main() -> int:
    """Run the program on this process's arguments and return its exit code.

    When the installation is so broken that the commands cannot even be imported, the program says
    what ``arm3dof doctor`` found.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # the matrices are small: threads cost more
    try:
        from arm3dof.cli import app
    except ImportError as error:
        doctor.explain(error)
        return 2
    return app.main(sys.argv[1:])
