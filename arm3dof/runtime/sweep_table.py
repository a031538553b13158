"""The CSV table of a sweep: written after each run, so that an interrupted sweep goes on later."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path

from arm3dof.errors import InputError
from arm3dof.files import write_atomically

_KEY = "key"
FIGURES = (
    "settling_time_s",
    "rms_error_rad",
    "final_error_rad",
    "energy_j",
    "torque_squared_n2m2s",
    "peak_torque_nm",
    "saturation",
    "violations",
    "step_time_p50_s",
)
"""The figures of merit in the table; the other columns are the settings."""


class SweepTable:
    """Rows by their key, kept in a CSV file that is replaced whole with each new row."""

    def __init__(self, path: Path | None) -> None:
        """Read what the file holds; without a path the table lives in memory.

        Raises:
            InputError: the file is not the table of a sweep.
        """
        self._path = path
        self._rows: dict[str, dict[str, str]] = {}
        if path is not None and path.exists():
            self._rows = _read(path)

    def __contains__(self, key: str) -> bool:
        return key in self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, key: str, values: Mapping[str, str | float | None]) -> None:
        """Add a row and write the file.

        Raises:
            InputError: the file cannot be written.
        """
        row = {name: "" if value is None else str(value) for name, value in values.items()}
        self._rows[key] = {_KEY: key, **row}
        if self._path is not None:
            write_atomically(self._path, _text(list(self._rows.values())).encode())

    def figures(self, key: str) -> dict[str, float | None]:
        """Return the figures of merit of a row; ``None`` where there is none."""
        row = self._rows[key]
        return {name: float(row[name]) if row[name] else None for name in FIGURES}


def _read(path: Path) -> dict[str, dict[str, str]]:
    refusal = f"{path}: not the table of a sweep; move it away or name another folder"
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            names = reader.fieldnames or ()
            if not {_KEY, *FIGURES} <= set(names):
                raise InputError(refusal)
            rows = list(reader)
        for row in rows:
            if None in row or None in row.values():
                raise InputError(refusal)
            for name in FIGURES:
                float(row[name] or 0)
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(refusal) from error
    return {row[_KEY]: row for row in rows}


def _text(rows: list[dict[str, str]]) -> str:
    names = dict.fromkeys(name for row in rows for name in row)
    buffer = io.StringIO(newline="")
    writer = csv.DictWriter(buffer, list(names), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()
