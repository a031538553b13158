"""Tables of measurements, for a terminal and for the manual."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Results of one benchmark.

    Attributes:
        title: what was measured.
        columns: headings, with units.
        rows: cells as text.
        note: how to read it.
    """

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""

    def text(self) -> str:
        """Return the table for a terminal."""
        lines = [self.columns, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        body = "\n".join(
            "  ".join(
                cell.ljust(width) if i == 0 else cell.rjust(width)
                for i, (cell, width) in enumerate(zip(line, widths, strict=True))
            )
            for line in lines
        )
        return "\n".join(filter(None, [self.title, body, self.note]))

    def rst(self) -> str:
        """Return the table as reStructuredText."""
        rows = "\n".join("   * - " + "\n     - ".join(line) for line in [self.columns, *self.rows])
        table = f".. list-table:: {self.title}\n   :header-rows: 1\n\n{rows}\n"
        return "\n\n".join(filter(None, [table, self.note])) + "\n"


def machine() -> str:
    """Return what the measurements were made on."""
    return (
        f"Python {platform.python_version()}, {platform.system()} {platform.machine()}, "
        f"{os.cpu_count()} cores"
    )
