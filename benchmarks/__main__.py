"""Run the benchmarks: ``python -m benchmarks [--quick] [NAME ...]``."""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from pathlib import Path

from benchmarks.tables import Table, machine

FOLDER = Path(__file__).parent
MEASURED = FOLDER.parent / "docs" / "measured"
NAMES = sorted(path.stem.removeprefix("bench_") for path in FOLDER.glob("bench_*.py"))


def main() -> None:
    """Run what was asked for, print its tables and, unless quick, keep them for the manual."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few repetitions: does it run at all")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of: {', '.join(NAMES)}")
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(NAMES):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; there are: {', '.join(NAMES)}")
    for name in arguments.names or NAMES:
        print(f"== {name}", file=sys.stderr, flush=True)
        found = import_module(f"benchmarks.bench_{name}").run(quick=arguments.quick)
        tables = [found] if isinstance(found, Table) else found
        for table in tables:
            print(f"\n{table.text()}\n", flush=True)
        if not arguments.quick:
            MEASURED.mkdir(exist_ok=True)
            report = "\n".join([*(table.rst() for table in tables), f"Measured on {machine()}.\n"])
            (MEASURED / f"{name}.rst").write_text(report)


if __name__ == "__main__":
    main()
