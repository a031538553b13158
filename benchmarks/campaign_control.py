"""Try to break the controller: ``python -m benchmarks.campaign_control fuzz|loops|disturbance``.

With ``--keep`` the tables are written where the manual includes them.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from arm3dof import MpcSettings
from arm3dof.runtime.parallel import Progress, run_all
from benchmarks import campaign_disturbance, campaign_fuzz, campaign_loops
from benchmarks.__main__ import MEASURED
from benchmarks.campaign_loops import Conditions, Loop
from benchmarks.tables import Table, machine

_CHUNK = 20  # controllers or loops that a worker takes at once


def fuzz(n: int, seed: int, workers: int = 1) -> tuple[dict[str, Any], list[Table]]:
    """Take so many hostile steps."""
    total = campaign_fuzz.Tally()
    tasks = [(seed, part) for part in _parts(campaign_fuzz.controllers(n))]
    for _, tally in run_all(campaign_fuzz.run_fuzz, tasks, workers=workers, progress=_progress()):
        total.add(tally)
    found = campaign_fuzz.summary(total)
    return found, [campaign_fuzz.table(found)]


def loops(
    n: int, seed: int, conditions: dict[str, Conditions], workers: int = 1
) -> tuple[dict[str, Any], list[Table]]:
    """Run so many random closed loops under each of some conditions."""
    found = {}
    for name, chosen in conditions.items():
        tasks = [(chosen, seed, part) for part in _parts(n)]
        ended: list[Loop] = []
        for _, part in run_all(
            campaign_loops.run_loops, tasks, workers=workers, progress=_progress()
        ):
            ended += part
        found[name] = campaign_loops.summary(sorted(ended, key=lambda loop: loop.index))
    return found, [campaign_loops.table(found)]


def disturbance() -> tuple[dict[str, Any], list[Table]]:
    """Measure loads, pushes, moments and delay."""
    found = campaign_disturbance.run()
    return found, campaign_disturbance.tables(found)


def main() -> None:
    """Run one campaign and print its tables, or one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaign_control")
    parser.add_argument("campaign", choices=("fuzz", "loops", "disturbance"))
    parser.add_argument("--n", type=int, default=1000, help="steps, or loops")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--settling-time", type=float, help="loops: tune the controller to it")
    parser.add_argument("--noise-deg", type=float, action="append", help="loops: repeatable")
    parser.add_argument("--model-error", type=float, default=30.0, help="loops: percent")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--keep", action="store_true", help="write the tables for the manual")
    arguments = parser.parse_args()
    n, seed, workers = arguments.n, arguments.seed, arguments.workers
    start = time.perf_counter()
    if arguments.campaign == "fuzz":
        found, tables = fuzz(n, seed, workers)
    elif arguments.campaign == "loops":
        wished = arguments.settling_time
        settings = MpcSettings() if wished is None else MpcSettings.tuned(wished)
        error = arguments.model_error
        conditions = {
            f"+-{error:g} % model error, {noise:g} deg noise": Conditions(settings, error, noise)
            for noise in arguments.noise_deg or (0.1,)
        }
        found, tables = loops(n, seed, conditions, workers)
    else:
        found, tables = disturbance()
    print(f"\n{time.perf_counter() - start:.0f} s", file=sys.stderr)
    print(json.dumps(found) if arguments.json else "\n\n".join(table.text() for table in tables))
    if arguments.keep:
        MEASURED.mkdir(exist_ok=True)
        report = "\n".join([*(table.rst() for table in tables), f"Measured on {machine()}.\n"])
        (MEASURED / f"campaign_{arguments.campaign}.rst").write_text(report)


def _parts(count: int) -> Sequence[range]:
    return [range(at, min(at + _CHUNK, count)) for at in range(0, count, _CHUNK)]


def _progress() -> Progress:
    start = time.perf_counter()

    def show(done: int, total: int) -> None:
        elapsed = time.perf_counter() - start
        text = f"\r{done}/{total} parts, {elapsed:.0f} s"
        print(text, end="", file=sys.stderr, flush=True)

    return show


if __name__ == "__main__":
    main()
