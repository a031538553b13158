"""What surrounds the robot: background, lights, floor and grid, sized to what is shown."""

from __future__ import annotations

import numpy as np

from arm3dof.state import Array
from arm3dof.ui import shapes
from arm3dof.ui.meshcat_window import Command

SKY = (0.957, 0.969, 0.98)
GROUND = (0.79, 0.83, 0.87)
FLOOR = (0.84, 0.865, 0.89)
GRID_LINE = (0.46, 0.54, 0.63)
VIEW_DIRECTIONS = {
    "Corner": (1.0, -1.15, 0.62),
    "Front": (1.0, 0.0, 0.10),
    "Side": (0.0, -1.0, 0.10),
    "Top": (0.0, -1e-3, 1.0),
}
HALF_FIELD_OF_VIEW = np.deg2rad(16.0)  # of the page's camera
MARGIN = 1.02  # of the view around what it must show
LINE_PIECES = 10  # of a line of the grid, which fades along it


def stage_commands(center: Array, radius: float, floor: float) -> list[Command]:
    """Return the commands that set the stage.

    Args:
        center: centre of what is shown, shape (3,) [m].
        radius: radius of the sphere around it [m].
        floor: height of the floor [m].
    """
    middle = np.array([center[0], center[1], floor])
    return [
        shapes.set_property("/Background", "top_color", SKY),
        shapes.set_property("/Background", "bottom_color", GROUND),
        shapes.set_property("/Grid", "visible", False),
        shapes.set_property("/Axes", "visible", False),
        *_lights(float(np.linalg.norm(center)) + radius),
        *_floor(middle, 3.5 * radius),
        *_grid(middle, 3.0 * radius, grid_step(radius)),
    ]


def view_command(center: Array, radius: float) -> Command:
    """Return the command that offers camera views of a sphere, the first of them shown.

    Args:
        center: centre of the sphere, shape (3,) [m].
        radius: its radius [m].
    """
    distance = MARGIN * radius / np.sin(HALF_FIELD_OF_VIEW)
    views = []
    for name, direction in VIEW_DIRECTIONS.items():
        unit = np.array(direction) / np.linalg.norm(direction)
        eye = center + distance * unit
        views.append({"name": name, "eye": eye.tolist(), "target": center.tolist()})
    return {"type": "views", "views": views}


def grid_step(radius: float) -> float:
    """Return a round distance (1, 2 or 5 times a power of ten) near a quarter of the radius."""
    wanted = radius / 4
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step for step in (1, 2, 5) if step * power <= wanted) * power)


def _lights(size: float) -> list[Command]:
    off = [
        shapes.set_property(f"/Lights/{name}", "visible", False)
        for name in (
            "SpotLight",
            "PointLightNegativeX",
            "PointLightPositiveX",
            "AmbientLight",
            "FillLight",
        )
    ]
    key = {
        "type": "DirectionalLight",
        "color": 0xFFF6EA,
        "intensity": 0.68,
        "castShadow": True,
        "shadow": {
            "mapSize": [2048, 2048],
            "radius": 3,
            "bias": -0.0004,
            "normalBias": 0.004 * size,
            "camera": {
                "type": "OrthographicCamera",
                "left": -1.6 * size,
                "right": 1.6 * size,
                "top": 1.6 * size,
                "bottom": -1.6 * size,
                "near": 0.1 * size,
                "far": 12 * size,
            },
        },
    }
    fill = {"type": "DirectionalLight", "color": 0xE4EEFF, "intensity": 0.22}
    sky = {
        "type": "HemisphereLight",
        "color": 0xFFFFFF,
        "groundColor": 0xB9C3CE,
        "intensity": 0.5,
    }
    # the viewer's menu stumbles over a light that is drawn in place of another
    gone = [shapes.delete(f"/Lights/{name}") for name in ("Key", "Fill", "Sky")]
    return [
        *off,
        *gone,
        shapes.draw_light("/Lights/Key", key, (1.2 * size, -2.4 * size, 4.2 * size)),
        shapes.draw_light("/Lights/Fill", fill, (-3 * size, 2 * size, 1.6 * size)),
        shapes.draw_light("/Lights/Sky", sky, (0.0, 0.0, size)),
        # the viewer gives every object a shadow; these lights have none to give
        shapes.set_property("/Lights/Fill/<object>", "castShadow", False),
        shapes.set_property("/Lights/Sky/<object>", "castShadow", False),
    ]


def _floor(middle: Array, radius: float) -> list[Command]:
    """Return a disc that fades into the background at its rim."""
    turns, rings = 72, ((0.0, 1.0), (0.45, 0.9), (0.75, 0.35), (1.0, 0.0))
    angles = np.linspace(0, 2 * np.pi, turns, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(turns)])
    points = np.concatenate([share * radius * circle for share, _ in rings])
    colors = np.concatenate([np.tile((*FLOOR, alpha), (turns, 1)) for _, alpha in rings])
    inner = np.arange(turns * (len(rings) - 1)).reshape(-1, turns)
    outer, after = inner + turns, np.roll(inner, -1, axis=1)
    faces = np.concatenate(
        [
            np.stack([inner, outer, after], axis=-1).reshape(-1, 3),
            np.stack([after, outer, after + turns], axis=-1).reshape(-1, 3),
        ]
    )
    shape = shapes.triangles(points, faces, colors=colors)
    look = shapes.material(
        (1, 1, 1), "Lambert", vertexColors=True, transparent=True, depthWrite=False
    )
    return [
        shapes.draw("/floor/disc", shape, look),
        shapes.move("/floor/disc", middle),
        shapes.set_property("/floor/disc/<object>", "castShadow", False),
        shapes.set_property("/floor/disc/<object>", "renderOrder", -2),
    ]


def _grid(middle: Array, radius: float, step: float) -> list[Command]:
    """Return lines at round distances from the base, fading away from the middle."""
    segments = []
    for axis in (0, 1):
        first = np.ceil((middle[axis] - radius) / step) * step
        for at in np.arange(first, middle[axis] + radius, step):
            half = np.sqrt(max(0.0, radius**2 - (at - middle[axis]) ** 2))
            along = middle[1 - axis] + np.linspace(-half, half, LINE_PIECES + 1)
            line = np.zeros((LINE_PIECES + 1, 3))
            line[:, axis], line[:, 1 - axis] = at, along
            segments.append(np.stack([line[:-1], line[1:]], axis=1).reshape(-1, 3))
    points = np.concatenate(segments)
    away = np.linalg.norm(points[:, :2] - middle[:2], axis=1) / radius
    colors = np.column_stack(
        [np.tile(GRID_LINE, (len(points), 1)), 0.6 * np.clip(1 - away, 0, 1) ** 1.4]
    )
    points[:, 2] = middle[2] + 1e-3 * radius
    look = shapes.line_material((1, 1, 1), vertexColors=True, transparent=True, depthWrite=False)
    return [
        shapes.draw("/floor/grid", shapes.triangles(points, colors=colors), look, "LineSegments"),
        shapes.set_property("/floor/grid/<object>", "renderOrder", -1),
    ]
