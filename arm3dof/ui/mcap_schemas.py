"""JSON schemas of the messages in an MCAP log: Foxglove's well-known ones, and two of our own.

Foxglove knows a message by the name of its schema; the schemas here say what is written, which is
a part of what Foxglove's allow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Schema = Mapping[str, object]

_NUMBER: Schema = {"type": "number"}
_TEXT: Schema = {"type": "string"}
_WHOLE: Schema = {"type": "integer", "minimum": 0}


def _object(title: str, **properties: Schema) -> Schema:
    return {"title": title, "type": "object", "properties": properties}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


_TIME = _object("time", sec=_WHOLE, nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999})
_DURATION = _object("duration", sec={"type": "integer"}, nsec=_WHOLE)
_VECTOR = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POINT = _object("foxglove.Point3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_TURN = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR, orientation=_TURN)
_COLOR = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)

FRAME_TRANSFORMS = _object(
    "foxglove.FrameTransforms",
    transforms=_list(
        _object(
            "foxglove.FrameTransform",
            timestamp=_TIME,
            parent_frame_id=_TEXT,
            child_frame_id=_TEXT,
            translation=_VECTOR,
            rotation=_TURN,
        )
    ),
)

_CUBE = _object("foxglove.CubePrimitive", pose=_POSE, size=_VECTOR, color=_COLOR)
_SPHERE = _object("foxglove.SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOR)
_CYLINDER = _object(
    "foxglove.CylinderPrimitive",
    pose=_POSE,
    size=_VECTOR,
    bottom_scale=_NUMBER,
    top_scale=_NUMBER,
    color=_COLOR,
)
_TRIANGLES = _object(
    "foxglove.TriangleListPrimitive",
    pose=_POSE,
    points=_list(_POINT),
    color=_COLOR,
    indices=_list(_WHOLE),
)
_LINE = _object(
    "foxglove.LinePrimitive",
    type={"oneOf": [{"title": "LINE_STRIP", "const": 0}]},
    pose=_POSE,
    thickness=_NUMBER,
    scale_invariant={"type": "boolean"},
    points=_list(_POINT),
    color=_COLOR,
)

SCENE_UPDATE = _object(
    "foxglove.SceneUpdate",
    entities=_list(
        _object(
            "foxglove.SceneEntity",
            timestamp=_TIME,
            frame_id=_TEXT,
            id=_TEXT,
            lifetime=_DURATION,
            frame_locked={"type": "boolean"},
            cubes=_list(_CUBE),
            spheres=_list(_SPHERE),
            cylinders=_list(_CYLINDER),
            lines=_list(_LINE),
            triangles=_list(_TRIANGLES),
        )
    ),
)

COMPRESSED_IMAGE = _object(
    "foxglove.CompressedImage",
    timestamp=_TIME,
    frame_id=_TEXT,
    data={"type": "string", "contentEncoding": "base64"},
    format=_TEXT,
)

STATUS = _object(
    "arm3dof.Status",
    timestamp=_TIME,
    status={"type": "string", "description": "name of the ControlStatus"},
    source={"type": "string", "description": "name of the TorqueSource"},
    sentence={"type": "string", "description": "both in plain words"},
    level={
        "type": "integer",
        "description": "0 an optimum, 1 a limit was softened, 2 the last plan, 3 braking",
    },
    step_time={"type": "number", "description": "wall time of the control step [s]"},
)


GRIPPER = _object(
    "arm3dof.Gripper",
    timestamp=_TIME,
    opening={"type": "number", "description": "between the fingers [m]"},
)


def joint_values(what: str, units: Mapping[str, str]) -> Schema:
    """Return the schema of one number a joint.

    Args:
        what: what the numbers are.
        units: their unit by joint.
    """
    numbers: dict[str, Schema] = {
        joint: {"type": "number", "description": f"{what} [{unit}]"}
        for joint, unit in units.items()
    }
    return _object("arm3dof.JointValues", timestamp=_TIME, **numbers)


def vector(values: Sequence[float]) -> dict[str, float]:
    """Return three numbers as a vector or point."""
    return dict(zip("xyz", map(float, values), strict=True))


def quaternion(values: Sequence[float]) -> dict[str, float]:
    """Return four numbers, w the last, as a quaternion."""
    return dict(zip("xyzw", map(float, values), strict=True))


def color(values: Sequence[float]) -> dict[str, float]:
    """Return red, green, blue and maybe opacity as a colour."""
    return dict(zip("rgba", (*map(float, values), 1.0)[:4], strict=True))
