"""Picture files that go into a report or a log: what kind they are, and small enough for a page."""

from __future__ import annotations

import base64
from pathlib import Path

import cv2
import numpy as np

from arm3dof.errors import InputError, MissingFile

MAX_PICTURE = 1_200_000
"""Bytes of a picture in a report, the whole of which stays below 5 MB."""

_SIDE = 1600  # px of the longer side of a picture that was too large
_KINDS = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpeg", b"RIFF": "webp"}


def read_picture(path: str | Path) -> bytes:
    """Read a picture for the report; one of over 1.2 MB is made smaller.

    Raises:
        MissingFile: there is no such file.
        InputError: it is no PNG, JPEG or WebP file, or damaged.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFile(f"{path}: no such picture; 'arm3dof see --out' writes one")
    data = path.read_bytes()
    picture_kind(data, str(path))
    return data if len(data) <= MAX_PICTURE else _smaller(data, str(path))


def picture_kind(picture: bytes, name: str = "the picture") -> str:
    """Return "png", "jpeg" or "webp".

    Args:
        picture: the bytes of a file.
        name: what the message calls it.

    Raises:
        InputError: it is of another kind.
    """
    for magic, kind in _KINDS.items():
        if picture.startswith(magic):
            return kind
    raise InputError(f"{name} is no PNG, JPEG or WebP file; give one of these")


def data_url(picture: bytes, name: str = "the picture") -> str:
    """Return a picture as an address that holds it whole.

    Args:
        picture: the bytes of a file.
        name: what the message calls it.

    Raises:
        InputError: it is of another kind than ``picture_kind`` knows, or too large.
    """
    kind = picture_kind(picture, name)
    if len(picture) > MAX_PICTURE:
        raise InputError(
            f"{name} has {len(picture) / 1e6:.1f} MB; give one of at most {MAX_PICTURE / 1e6:g} MB"
        )
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode()}"


def _smaller(picture: bytes, name: str) -> bytes:
    """Return a large picture as a JPEG file that fits."""
    image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{name} is damaged; give a whole PNG, JPEG or WebP file")
    share = min(1.0, _SIDE / max(image.shape[:2]))
    while True:
        small = cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes()
        if len(data) <= MAX_PICTURE:
            return data
        share *= 0.8
