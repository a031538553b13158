"""What the commands say: one JSON object or readable text on stdout, progress on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from arm3dof.ui.summary import to_json

DONE = 0
ANSWER_IS_NO = 1
BAD_INPUT = 2
INTERRUPTED = 130
_WIDE = 200


def out() -> Console:
    """Return the console that answers go to; into a file or pipe, tables keep their full width."""
    width = None if sys.stdout.isatty() else _WIDE
    return Console(highlight=False, soft_wrap=True, width=width)


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


def table(*columns: str) -> Table:
    """Return an empty table in the house style; a column with a unit is aligned to the right."""
    made = Table(box=None, pad_edge=False, header_style="bold")
    for column in columns:
        made.add_column(escape(column), justify="right" if "[" in column else "left")
    return made
