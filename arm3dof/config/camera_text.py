"""How a camera and its targets are written in a CAMERA.toml."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping

from arm3dof.errors import InputError
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget

BARE_KEY = "[A-Za-z0-9_-]+"
"""Pattern of a TOML key that needs no quotes."""


def render_camera(
    camera: Camera, targets: Mapping[str, ColourTarget] | Iterable[ColourTarget] = ()
) -> str:
    """Return the text of a CAMERA.toml."""
    inner, pose = camera_tables(camera)
    named = targets.values() if isinstance(targets, Mapping) else targets
    tables = {"intrinsics": inner, "pose": pose} | {
        f"targets.{toml_key(target.name)}": target_table(target) for target in named
    }
    parts = (
        "\n".join([f"[{name}]", *(f"{key} = {value}" for key, value in table.items())])
        for name, table in tables.items()
    )
    return "\n\n".join(parts) + "\n"


def camera_tables(camera: Camera) -> tuple[dict[str, str], dict[str, str]]:
    """Return the keys of [intrinsics] and [pose], as TOML writes their values.

    Raises:
        InputError: the camera's pixels are skewed.
    """
    matrix, pose, doubt = camera.camera_matrix, camera.transform_base_camera, camera.doubt
    if matrix[0, 1] != 0:
        raise InputError(
            f"the camera's pixels are skewed ({matrix[0, 1]}), which a CAMERA.toml cannot say; "
            "give a camera_matrix without skew"
        )
    inner = {
        "width": str(camera.width),
        "height": str(camera.height),
        "fx": repr(float(matrix[0, 0])),
        "fy": repr(float(matrix[1, 1])),
        "cx": repr(float(matrix[0, 2])),
        "cy": repr(float(matrix[1, 2])),
        "distortion": str(camera.distortion.tolist()),
    }
    if camera.gamma is not None:
        inner["gamma"] = repr(float(camera.gamma))
    inner |= _said(focal_sigma_px=doubt.focal_px, centre_sigma_px=doubt.centre_px)
    rows = "".join(f"    {row},\n" for row in pose[:3, :3].tolist())
    placed = {"position_m": str(pose[:3, 3].tolist()), "rotation": f"[\n{rows}]"}
    degrees = round(math.degrees(doubt.rotation_rad), 9)
    return inner, placed | _said(position_sigma_m=doubt.position_m, rotation_sigma_deg=degrees)


def _said(**sigmas: float) -> dict[str, str]:
    """Return the deviations that are not 0."""
    return {name: repr(float(value)) for name, value in sigmas.items() if value != 0}


def target_table(target: ColourTarget) -> dict[str, str]:
    """Return the keys of a [targets.NAME], as TOML writes their values."""
    return {
        "hsv_low": str(list(target.hsv.low)),
        "hsv_high": str(list(target.hsv.high)),
        "width_m": repr(float(target.width_m)),
        "shape": f'"{target.shape}"',
        "width_sigma_m": repr(float(target.width_sigma_m)),
    }


def toml_key(name: str) -> str:
    """Write a TOML key, in quotes where it must be."""
    return name if re.fullmatch(BARE_KEY, name) else json.dumps(name)
