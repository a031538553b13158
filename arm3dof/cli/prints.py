"""What a pose is measured from: a print in a picture, or a table of points."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from arm3dof.cli.options import number, numbers
from arm3dof.errors import InputError
from arm3dof.files import unreadable
from arm3dof.state import Array


def find_print(
    image: Path | None,
    aruco: int | None,
    size_m: float | None,
    board: str | None,
    square_m: float | None,
    at: str | None,
    yaw_deg: float,
) -> tuple[Array, Array]:
    """Find a print in a picture; return its points in the base frame and where they are seen.

    Raises:
        InputError: the options do not say what and where the print is, or it is not seen.
    """
    from arm3dof.vision.chessboard import board_corners, board_points
    from arm3dof.vision.pose import lying, marker_corners, marker_points
    from arm3dof.vision.sources import read_image

    if image is None or at is None or (aruco is None) == (board is None):
        raise InputError(
            "give IMAGE, --at X,Y,Z and one of --aruco ID --size-m S and --board CxR --square-m S; "
            "or --points CSV"
        )
    picture = read_image(image)
    if aruco is not None:
        flat, seen = marker_points(size_m or 0), marker_corners(picture, aruco)
        what = f"marker {aruco}"
    else:
        columns, rows = board_size(board or "")
        flat, seen = (
            board_points(columns, rows, square_m or 0),
            board_corners(picture, columns, rows),
        )
        what = f"whole board of {board} corners"
    if seen is None:
        raise InputError(f"no {what} is in {image}; let all of it and a white margin be seen")
    place = lying(flat, numbers(at, 3, "--at"), math.radians(yaw_deg))
    return place, seen


def read_points(path: Path) -> tuple[Array, Array]:
    """Read points in space and their pixels from a CSV file with a head.

    Raises:
        MissingFile: the file cannot be read.
        InputError: it lacks columns, or holds what is no number.
    """
    names = ["x", "y", "z", "u", "v"]
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            if not set(names) <= set(reader.fieldnames or ()):
                raise InputError(f"{path} lacks columns; give a head with x,y,z,u,v")
            rows = [
                [number(row[name] or "", f"{path} line {line}: {name}") for name in names]
                for line, row in enumerate(reader, start=2)
            ]
    except OSError as error:
        raise unreadable(str(path), error, "give a CSV file") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{path} is not a CSV file") from None
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return table[:, :3], table[:, 3:]


def board_size(text: str) -> tuple[int, int]:
    """Read columns and rows of inner corners.

    Raises:
        InputError: the text is not COLUMNSxROWS.
    """
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts):
        raise InputError(f"--board is '{text}'; give the inner corners as COLUMNSxROWS, like 9x6")
    return int(parts[0]), int(parts[1])
