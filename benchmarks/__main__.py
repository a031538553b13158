"""Run the benchmarks: ``python -m benchmarks [--quick] [NAME ...]``."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.tables import Table, machine

FOLDER = Path(__file__).parent
REPORT = FOLDER.parent / "docs" / "_generated" / "benchmarks.rst"
NAMES = sorted(path.stem.removeprefix("bench_") for path in FOLDER.glob("bench_*.py"))


def main() -> None:
    """Run what was asked for, print its tables and, when all ran in full, write the report."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few repetitions: does it run at all")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of: {', '.join(NAMES)}")
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(NAMES):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; there are: {', '.join(NAMES)}")
    tables: list[Table] = []
    for name in arguments.names or NAMES:
        print(f"== {name}", file=sys.stderr, flush=True)
        tables.append(import_module(f"benchmarks.bench_{name}").run(quick=arguments.quick))
        print(f"\n{tables[-1].text()}\n", flush=True)
    if not arguments.names and not arguments.quick:
        REPORT.parent.mkdir(parents=True, exist_ok=True)
        REPORT.write_text("\n".join([f"{machine()}.\n", *(table.rst() for table in tables)]))
        print(f"wrote {REPORT}")


if __name__ == "__main__":
    main()
