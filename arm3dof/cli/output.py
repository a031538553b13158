"""What the commands say: one JSON object or readable text on stdout, progress on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, is_dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

DONE = 0
ANSWER_IS_NO = 1
BAD_INPUT = 2
INTERRUPTED = 130


def out() -> Console:
    """Return the console that answers go to (made afresh: tests replace stdout)."""
    return Console(highlight=False, soft_wrap=True)


def err() -> Console:
    """Return the console that progress and advice go to."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def deliver(
    report: Mapping[str, object],
    *,
    as_json: bool,
    show: Callable[[Console], None],
    yes: bool = True,
) -> int:
    """Print an answer and return its exit code.

    Args:
        report: the answer as plain names and values; this is what ``--json`` prints.
        as_json: print ``report`` as one JSON object and nothing else.
        show: prints the same for people.
        yes: whether the command did what was asked for.
    """
    if as_json:
        sys.stdout.write(to_json(report) + "\n")
        sys.stdout.flush()
    else:
        show(out())
    return DONE if yes else ANSWER_IS_NO


def to_json(report: object) -> str:
    """Return strict JSON: arrays become lists, and a number that is not finite becomes null."""
    return json.dumps(_plain(report), indent=2, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Enum):
        return _plain(value.value)
    if isinstance(value, Path):
        return str(value)
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    return value


def table(*columns: str, title: str | None = None) -> Table:
    """Return an empty table in the house style: no box, numbers aligned by their column's name.

    A column whose name ends in a unit, ``"mass [kg]"``, is right-aligned.
    """
    made = Table(title=title, box=None, pad_edge=False, header_style="bold", title_justify="left")
    for column in columns:
        made.add_column(column.replace("[", r"\["), justify="right" if "]" in column else "left")
    return made
