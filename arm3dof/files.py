"""Writing files whole or not at all, and saying why one cannot be read."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from arm3dof.errors import InputError, MissingFile


def unreadable(what: str, error: OSError, cure: str) -> MissingFile:
    """Return the error to raise for a file that cannot be read.

    Args:
        what: the file, as messages call it.
        error: why it cannot be read.
        cure: what to give instead.
    """
    reason = error.strerror or type(error).__name__
    return MissingFile(f"cannot read {what}: {reason}; {cure}")


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file beside its place, then move it there; its folder is made when missing.

    Raises:
        InputError: the folder cannot be made or written.
    """
    with draft_of(path) as draft:
        draft.write_bytes(data)


@contextmanager
def draft_of(path: Path) -> Iterator[Path]:
    """Give an empty file to write to, which takes its place when the block ends without an error.

    For what is written piece by piece; an error or Ctrl-C leaves whatever was at ``path`` before.

    Raises:
        InputError: the folder cannot be made or written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
        draft = Path(name)
        try:
            yield draft
            draft.chmod(0o644)  # mkstemp's files are for their owner alone
            draft.replace(path)
        except BaseException:
            draft.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); name a folder that you may write to"
        ) from None
