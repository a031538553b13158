"""Changing keys of a TOML text in place, so that its comments and its order stay."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

_HEADER = re.compile(r"^\s*\[([^\[\]]+)\]\s*(#.*)?$")


def set_keys(text: str, table: str, values: Mapping[str, str], drop: Iterable[str] = ()) -> str:
    """Give keys of a table new values, add those that are missing, and drop some.

    The table is made at the end of the text when it is missing. Tables must be written under
    headers of their own, ``[targets.red]``, with a key a line; a value may run over several lines.

    Args:
        text: the TOML text.
        table: the table's name, as in its header.
        values: the keys and their values, as TOML writes them.
        drop: keys to take out.
    """
    lines = text.splitlines()
    start, end = _find(lines, table)
    if start is None:
        gap = [""] if lines and lines[-1].strip() else []
        body = [f"{key} = {value}" for key, value in values.items()]
        return "\n".join([*lines, *gap, f"[{table}]", *body]) + "\n"
    body = lines[start:end]
    for key in drop:
        if (place := _key(body, key)) is not None:
            del body[place[0] : place[1]]
    for key, value in values.items():
        place = _key(body, key)
        if place is None:
            body.insert(_last(body), f"{key} = {value}")
            continue
        first, stop = place
        note = _comment(body[stop - 1])
        body[first:stop] = f"{key} = {value}{note}".splitlines()
    return "\n".join([*lines[:start], *body, *lines[end:]]) + "\n"


def _find(lines: Sequence[str], table: str) -> tuple[int | None, int]:
    """Return where a table's lines begin and end, its header left out."""
    headers = [
        (index, "".join(match[1].split()))
        for index, line in enumerate(lines)
        if (match := _HEADER.match(line))
    ]
    for place, (index, name) in enumerate(headers):
        if name == table:
            following = headers[place + 1 :]
            return index + 1, following[0][0] if following else len(lines)
    return None, len(lines)


def _key(body: Sequence[str], key: str) -> tuple[int, int] | None:
    """Return the first line of a key and that after its value."""
    wanted = re.compile(rf"^\s*{re.escape(key)}\s*=")
    for first, line in enumerate(body):
        if wanted.match(line):
            stop, depth = first, 0
            while stop < len(body):
                bare = _bare(body[stop])
                depth += bare.count("[") - bare.count("]")
                stop += 1
                if depth <= 0:
                    break
            return first, stop
    return None


def _last(body: Sequence[str]) -> int:
    """Return the place after the last line that is a part of a key."""
    for index in range(len(body), 0, -1):
        if _bare(body[index - 1]).strip():
            return index
    return 0


def _bare(line: str) -> str:
    """Return a line without its comment and its strings."""
    return re.sub(r"""("[^"]*"|'[^']*')|#.*""", lambda match: '""' if match[1] else "", line)


def _comment(line: str) -> str:
    """Return the comment at the end of a line, with the space before it."""
    for match in re.finditer(r"""("[^"]*"|'[^']*')|(\s*#.*)""", line):
        if match[2] is not None:
            return match[2]
    return ""
