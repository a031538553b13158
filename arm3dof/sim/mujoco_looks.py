"""How a MuJoCo world looks: a wooden table, matte colours, soft light and a quiet background."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from arm3dof.sim.engine import mujoco
from arm3dof.sim.table import Table
from arm3dof.sim.world import World

WOOD, PLAIN, MATTE = "wood", "plain", "matte"
_TEXEL = 0.002  # size of a point of the wood's picture [m]
_GAMMA = 2.2
_AMBIENT, _FILL, _LAMP = 0.36, 0.22, 0.46  # light from all round, from the camera, of the lamp
_TO_LAMP = np.array([1.0, 0.67, 2.5])  # from the table's middle [m]
_PLAIN_GREY = (0.62, 0.63, 0.64, 1.0)
_HORIZON, _ZENITH = (0.62, 0.65, 0.67), (0.86, 0.88, 0.89)


def add_looks(spec: mujoco.MjSpec, world: World) -> None:
    """Add light, background, and the materials ``WOOD``, ``PLAIN`` and ``MATTE``.

    Args:
        spec: the world that is built.
        world: its table and the brightness of its light.
    """
    _add_light(spec, world.table, world.light)
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    sky.builtin = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky.rgb1 = np.clip(np.array(_ZENITH) * world.light, 0, 1)
    sky.rgb2 = np.clip(np.array(_HORIZON) * world.light, 0, 1)
    sky.width, sky.height = 64, 384
    picture = _wood(world.table)
    wood = spec.add_texture(name=WOOD, type=mujoco.mjtTexture.mjTEXTURE_2D)
    wood.height, wood.width, wood.nchannel = picture.shape
    wood.data = picture.tobytes()
    material = spec.add_material(name=WOOD, specular=0.1, shininess=0.3, texrepeat=(1.0, 1.0))
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = WOOD
    spec.add_material(name=PLAIN, specular=0.1, shininess=0.3, rgba=_PLAIN_GREY)
    spec.add_material(name=MATTE, specular=0.08, shininess=0.2)


def _add_light(spec: mujoco.MjSpec, table: Table, brightness: float) -> None:
    """Add light from all round, and a lamp that is far away and casts shadows on the table."""
    middle = np.array([*table.centre, table.height])
    head = spec.visual.headlight
    head.ambient = np.full(3, _AMBIENT * brightness)
    head.diffuse = np.full(3, _FILL * brightness)
    head.specular = np.zeros(3)
    # a lamp whose cone just holds the table: shadows of a directional light have flaws at its edge
    reach = math.hypot(*table.half_size)
    lamp = spec.worldbody.add_light(
        name="lamp",
        type=mujoco.mjtLightType.mjLIGHT_SPOT,
        pos=middle + _TO_LAMP,
        dir=-_TO_LAMP,
        diffuse=np.full(3, _LAMP * brightness),
        specular=np.full(3, 0.3 * brightness),
        castshadow=True,
    )
    lamp.cutoff = 1.08 * math.degrees(math.atan2(reach, float(np.linalg.norm(_TO_LAMP))))
    lamp.exponent, lamp.attenuation = 0.0, (1.0, 0.0, 0.0)
    spec.visual.map.shadowscale = 1.0
    spec.stat.extent, spec.stat.center = 1.0, middle
    quality = spec.visual.quality
    quality.numslices, quality.numstacks, quality.numquads = 32, 2, 1


@lru_cache(maxsize=8)
def _wood(table: Table) -> NDArray[np.uint8]:
    """Draw the table's top from above, sRGB, shape (rows along y, columns along x, 3)."""
    x, y = (
        np.arange(-half + _TEXEL / 2, half, _TEXEL, dtype=np.float32) + centre
        for half, centre in zip(table.half_size, table.centre, strict=True)
    )
    points = np.zeros((3, y.size * x.size), np.float32)
    points[0], points[1] = np.tile(x, y.size), np.repeat(y, x.size)
    linear = np.clip(table.colours(points), 0, 1).reshape(3, y.size, x.size)
    return (255 * linear.transpose(1, 2, 0) ** (1 / _GAMMA) + 0.5).astype(np.uint8)
