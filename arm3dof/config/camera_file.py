"""CAMERA.toml: what a camera is, where it stands, and the coloured objects that it looks for.

Everything in the file is in metres and pixels; hues are in OpenCV's half degrees. The tables are
``[intrinsics]``, ``[pose]`` and one ``[targets.NAME]`` for each kind of object.
"""

from __future__ import annotations

import json
import os
import re
import tempfile
import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from arm3dof.config.explain import explain
from arm3dof.errors import InputError, MissingFile
from arm3dof.vision.camera import Camera, intrinsics, look_at
from arm3dof.vision.colour import ColourTarget, HsvRange, Shape

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
Hsv = tuple[int, int, int]

_BARE = "[A-Za-z0-9_-]+"  # a TOML key without quotes


class CameraFile(NamedTuple):
    """What a CAMERA.toml says.

    Attributes:
        camera: the camera and its pose.
        targets: the objects it looks for, by name.
    """

    camera: Camera
    targets: dict[str, ColourTarget]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _Intrinsics(_Table):
    width: Annotated[int, Field(ge=1)]
    height: Annotated[int, Field(ge=1)]
    fx: Positive
    fy: Positive | None = None
    cx: Finite | None = None
    cy: Finite | None = None
    distortion: tuple[Finite, ...] = ()


class _Pose(_Table):
    position_m: Point
    rotation: tuple[Point, Point, Point] | None = None
    look_at_m: Point | None = None


class _Target(_Table):
    hsv_low: Hsv
    hsv_high: Hsv
    width_m: Positive
    shape: Shape = "flat"
    width_sigma_m: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0


class _File(_Table):
    intrinsics: _Intrinsics
    pose: _Pose
    targets: dict[Annotated[str, Field(pattern=f"^{_BARE}$")], _Target] = {}


def presets() -> tuple[str, ...]:
    """Return the names of the cameras that come with the package."""
    folder = resources.files("arm3dof.config") / "cameras"
    names = (entry.name for entry in folder.iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def load_camera(source: str | Path) -> CameraFile:
    """Read a CAMERA.toml, or one of the presets by its name.

    Args:
        source: a path, or a name that ``presets`` lists.

    Returns:
        The camera and its targets.

    Raises:
        MissingFile: there is no such file and no such preset.
        InputError: the file is not TOML, or a key is missing, unknown or out of range.
    """
    if str(source) in presets():
        text = (resources.files("arm3dof.config") / "cameras" / f"{source}.toml").read_text("utf-8")
        return parse_camera(text, f"camera preset '{source}'")
    path = Path(source)
    try:
        text = path.read_text("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text file; give a CAMERA.toml") from None
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise MissingFile(
            f"cannot read the camera {path}: {reason}; give a CAMERA.toml or one of the presets: "
            + ", ".join(presets())
        ) from None
    return parse_camera(text, str(path))


def parse_camera(text: str, name: str) -> CameraFile:
    """Read the text of a CAMERA.toml.

    Args:
        text: the file's text.
        name: what messages call it.

    Raises:
        InputError: the text is not TOML, or a key is missing, unknown or out of range.
    """
    try:
        file = _File.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name} is not TOML: {error}; correct it there") from None
    except ValidationError as error:
        raise InputError(f"{name}: {explain(error, _File)}") from None
    targets = {key: _target(name, key, table) for key, table in file.targets.items()}
    return CameraFile(_camera(name, file), targets)


def save_camera(
    path: str | Path,
    camera: Camera,
    targets: Mapping[str, ColourTarget] | Iterable[ColourTarget] = (),
) -> Path:
    """Write a CAMERA.toml; comments in a file that is there already are lost.

    Args:
        path: where to.
        camera: the camera.
        targets: the objects it looks for.

    Returns:
        The path.

    Raises:
        InputError: a target's name is no bare TOML key, or the file cannot be written.
    """
    path = Path(path)
    named = targets.values() if isinstance(targets, Mapping) else targets
    text = render_camera(camera, named)
    parse_camera(text, str(path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, draft = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(draft).chmod(0o644)
        Path(draft).replace(path)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(f"cannot write {path}: {reason}; give a place to write to") from None
    return path


def render_camera(camera: Camera, targets: Iterable[ColourTarget] = ()) -> str:
    """Return the text of a CAMERA.toml."""
    matrix, pose = camera.camera_matrix, camera.transform_base_camera
    if matrix[0, 1] != 0:
        raise InputError(
            f"the camera's pixels are skewed ({matrix[0, 1]}), which a CAMERA.toml cannot say; "
            "give a camera_matrix without skew"
        )
    lines = [
        "[intrinsics]",
        f"width = {camera.width}",
        f"height = {camera.height}",
        f"fx = {float(matrix[0, 0])!r}",
        f"fy = {float(matrix[1, 1])!r}",
        f"cx = {float(matrix[0, 2])!r}",
        f"cy = {float(matrix[1, 2])!r}",
        f"distortion = {camera.distortion.tolist()}",
        "",
        "[pose]",
        f"position_m = {pose[:3, 3].tolist()}",
        "rotation = [",
        *(f"    {row}," for row in pose[:3, :3].tolist()),
        "]",
    ]
    for target in targets:
        lines += [
            "",
            f"[targets.{_key(target.name)}]",
            f"hsv_low = {list(target.hsv.low)}",
            f"hsv_high = {list(target.hsv.high)}",
            f"width_m = {float(target.width_m)!r}",
            f'shape = "{target.shape}"',
            f"width_sigma_m = {float(target.width_sigma_m)!r}",
        ]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    """Write a TOML key, in quotes where it must be."""
    return name if re.fullmatch(_BARE, name) else json.dumps(name)


def _camera(name: str, file: _File) -> Camera:
    inner, pose = file.intrinsics, file.pose
    cx = (inner.width - 1) / 2 if inner.cx is None else inner.cx
    cy = (inner.height - 1) / 2 if inner.cy is None else inner.cy
    matrix = intrinsics(inner.fx, inner.fx if inner.fy is None else inner.fy, cx, cy)
    if (pose.rotation is None) == (pose.look_at_m is None):
        have = "neither" if pose.rotation is None else "both"
        raise InputError(
            f"{name}: pose has {have} of rotation and look_at_m; give one of them: the 3 x 3 "
            "rotation, base from optical frame, or the point that the camera looks at"
        )
    try:
        if pose.look_at_m is not None:
            transform = look_at(pose.position_m, pose.look_at_m)
        else:
            transform = np.eye(4)
            transform[:3, :3] = pose.rotation
            transform[:3, 3] = pose.position_m
        return Camera(inner.width, inner.height, matrix, np.array(inner.distortion), transform)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _target(name: str, key: str, table: _Target) -> ColourTarget:
    try:
        return ColourTarget(
            key,
            HsvRange(table.hsv_low, table.hsv_high),
            table.width_m,
            table.shape,
            table.width_sigma_m,
        )
    except InputError as error:
        raise InputError(f"{name}: targets.{key}: {error}") from None
