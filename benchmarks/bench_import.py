"""What ``import arm3dof`` costs beside the libraries that it cannot do without."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

from benchmarks.tables import Table

CASES = {
    "pinocchio, proxsuite, numpy": "import pinocchio, proxsuite, numpy",
    "arm3dof": "import arm3dof",
    "every public name of arm3dof": "from arm3dof import *",
}


def run(*, quick: bool) -> Table:
    """Time fresh interpreters, in turns, less the time of an empty one."""
    repetitions = 3 if quick else 21
    codes = {"": "pass", **CASES}
    times: dict[str, list[float]] = {name: [] for name in codes}
    for _ in range(repetitions):
        for name, code in codes.items():
            start = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True)
            times[name].append(time.perf_counter() - start)
    empty = statistics.median(times.pop(""))
    cost = {name: statistics.median(values) - empty for name, values in times.items()}
    base = cost["pinocchio, proxsuite, numpy"]
    rows = [(name, f"{1e3 * value:.0f}", f"{value / base:.2f}") for name, value in cost.items()]
    return Table(
        "Import",
        ("import", "median [ms]", "ratio"),
        rows,
        f"Median of {repetitions} fresh interpreters each, in turns.",
    )
