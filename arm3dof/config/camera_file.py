"""CAMERA.toml: what a camera is, where it stands, and the coloured objects that it looks for.

Everything in the file is in metres and pixels; hues are in OpenCV's half degrees. The tables are
``[intrinsics]``, ``[pose]`` and one ``[targets.NAME]`` for each kind of object.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from arm3dof.config.camera_text import (
    BARE_KEY,
    camera_tables,
    render_camera,
    target_table,
    toml_key,
)
from arm3dof.config.explain import explain
from arm3dof.config.toml_edit import set_keys
from arm3dof.errors import InputError
from arm3dof.files import unreadable, write_atomically
from arm3dof.vision.camera import Camera, Doubt, intrinsics, look_at
from arm3dof.vision.colour import ColourTarget, HsvRange, Shape

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
Hsv = tuple[int, int, int]


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
    gamma: Positive | None = None
    focal_sigma_px: NotNegative = 0.0
    centre_sigma_px: NotNegative = 0.0


class _Pose(_Table):
    position_m: Point
    rotation: tuple[Point, Point, Point] | None = None
    look_at_m: Point | None = None
    position_sigma_m: NotNegative = 0.0
    rotation_sigma_deg: NotNegative = 0.0


class _Target(_Table):
    hsv_low: Hsv
    hsv_high: Hsv
    width_m: Positive
    shape: Shape = "flat"
    width_sigma_m: NotNegative = 0.0


class _File(_Table):
    intrinsics: _Intrinsics
    pose: _Pose
    targets: dict[Annotated[str, Field(pattern=f"^{BARE_KEY}$")], _Target] = {}


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
        return parse_camera(_preset(str(source)), f"camera preset '{source}'")
    path = Path(source)
    try:
        text = path.read_text("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text file; give a CAMERA.toml") from None
    except OSError as error:
        cure = "give a CAMERA.toml or one of the presets: " + ", ".join(presets())
        raise unreadable(f"the camera {path}", error, cure) from None
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
    text = render_camera(camera, targets)
    parse_camera(text, str(path))
    write_atomically(path, text.encode())
    return path


def update_camera(
    path: str | Path, *, camera: Camera | None = None, target: ColourTarget | None = None
) -> Path:
    """Change a CAMERA.toml in place; its comments and what is not changed stay.

    Args:
        path: the file, or the name of a preset: then a copy of it is made in the working folder.
        camera: the camera that it is to hold.
        target: a target to add, or to replace by its name.

    Returns:
        The path that was written.

    Raises:
        MissingFile: there is no such file and no such preset.
        InputError: the file cannot be read, changed in place or written, a preset's copy exists
            already, or the target's name is no bare TOML key.
    """
    text, path = _text_to_change(path)
    before = parse_camera(text, str(path))
    wanted = before._replace(
        camera=camera or before.camera,
        targets=before.targets | ({} if target is None else {target.name: target}),
    )
    if camera is not None:
        inner, pose = camera_tables(camera)
        text = set_keys(text, "intrinsics", inner, drop=set(_Intrinsics.model_fields) - set(inner))
        text = set_keys(text, "pose", pose, drop=set(_Pose.model_fields) - set(pose))
    if target is not None:
        text = set_keys(text, f"targets.{toml_key(target.name)}", target_table(target))
    after = parse_camera(text, str(path))
    if after.targets != wanted.targets or not _alike(after.camera, wanted.camera):
        raise InputError(
            f"{path} cannot be changed in place; write each table under its own [header], or let "
            "save_camera write it anew"
        )
    write_atomically(path, text.encode())
    return path


def _alike(first: Camera, second: Camera) -> bool:
    """Whether two cameras are the same but for rounding."""
    tables = [
        tomllib.loads(render_camera(replace(it, transform_base_camera=np.eye(4))))
        for it in (first, second)
    ]
    poses = first.transform_base_camera, second.transform_base_camera
    return tables[0] == tables[1] and np.allclose(*poses, rtol=0, atol=1e-12)


def _text_to_change(source: str | Path) -> tuple[str, Path]:
    if str(source) in presets():
        copy = Path(f"{source}.toml")
        if copy.exists():
            raise InputError(f"{copy} exists already; give it as the camera, --camera {copy}")
        return _preset(str(source)), copy
    path = Path(source)
    load_camera(path)  # says what is wrong with it
    return path.read_text("utf-8"), path


def _preset(name: str) -> str:
    return (resources.files("arm3dof.config") / "cameras" / f"{name}.toml").read_text("utf-8")


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
        doubt = Doubt(
            inner.focal_sigma_px,
            inner.centre_sigma_px,
            pose.position_sigma_m,
            math.radians(pose.rotation_sigma_deg),
        )
        return Camera(
            inner.width,
            inner.height,
            matrix,
            np.array(inner.distortion),
            transform,
            inner.gamma,
            doubt,
        )
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
