"""A file to which results are added one by one, so that work that was stopped goes on later."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from arm3dof.errors import InputError
from arm3dof.files import write_atomically

_SOURCES = (".py", ".toml", ".urdf")


class Journal:
    """Results by key, one JSON object a line; without a path they live in memory.

    A line that a crash cut short is forgotten, and written anew when its result is known again.
    """

    def __init__(self, path: Path | None) -> None:
        """Read what the file holds.

        Args:
            path: the file; it is made with the first result, and its folder too.

        Raises:
            InputError: the file is not a journal, or cannot be read.
        """
        self._path = path
        self._results: dict[str, dict[str, Any]] = {}
        self._torn = False
        if path is not None and path.exists():
            self._read(path)

    def __contains__(self, key: str) -> bool:
        return key in self._results

    def __getitem__(self, key: str) -> Mapping[str, Any]:
        return self._results[key]

    def add(self, key: str, result: Mapping[str, Any]) -> None:
        """Keep a result, made of what JSON can say.

        Raises:
            InputError: the file cannot be written.
        """
        line = json.dumps({"key": key, **result}, allow_nan=False)
        self._results[key] = json.loads(line)
        if self._path is None:
            return
        if self._torn:
            lines = (json.dumps(it) + "\n" for it in self._results.values())
            write_atomically(self._path, "".join(lines).encode())
            self._torn = False
            return
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError as error:
            raise InputError(
                f"{self._path}: cannot be written ({error.strerror}); name a folder to write to"
            ) from None

    def _read(self, path: Path) -> None:
        refusal = f"{path}: not a journal of results; move it away or name another folder"
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(refusal) from error
        self._torn = bool(text) and not text.endswith("\n")
        lines = text.splitlines()
        for number, line in enumerate(lines, start=1):
            try:
                result = json.loads(line)
                self._results[result["key"]] = result
            except (ValueError, TypeError, KeyError) as error:
                if number == len(lines) and self._torn:
                    break
                raise InputError(f"{refusal} (line {number})") from error


def fingerprint(*facts: object) -> str:
    """Return what tells one piece of work from another: a short hash of all it depends on.

    Args:
        facts: values that JSON can say, or whose text says all that matters.
    """
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def code_fingerprint() -> str:
    """Return a short hash of the package's own code: a result of other code is another result."""
    digest = hashlib.sha256()
    folder = Path(str(resources.files("arm3dof")))
    for path in sorted(it for it in folder.rglob("*") if it.suffix in _SOURCES):
        digest.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
