"""A table with three objects of different colours, one of which is to be moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.runtime.tasks.grasp_trial import GraspTask, as_seen, draw_place, gripping_of
from arm3dof.runtime.tasks.gripping import Grip
from arm3dof.sim.scatter import Region, scatter
from arm3dof.sim.world import COLOURS, World

_REGION = Region(radius=(0.15, 0.215), bearing=(-0.75, 0.75))
_WIDTHS, _HEIGHTS = (0.024, 0.034), (0.035, 0.055)  # [m]
_GAP = 0.045  # [m]
_TRIES = 200


def three_objects(
    robot: Robot, rng: np.random.Generator, target: str, colours: Sequence[str]
) -> GraspTask:
    """Draw a table with an object of each colour, and a place for one of them.

    Args:
        robot: the robot that is to move it.
        rng: decides everything.
        target: the colour of what is to be moved.
        colours: up to three colours of the world, the target's among them.

    Raises:
        InputError: the colour is none of the world's, or this robot can grasp nothing that is
            drawn.
    """
    known = [name for name in colours if name in COLOURS]
    if target not in known:
        raise InputError(f"there is no {target} object; give one of: {', '.join(known)}")
    names = [target, *(name for name in known if name != target)][:3]
    gripping = gripping_of(robot)
    for _ in range(_TRIES):
        bodies = scatter(
            rng,
            len(names),
            colours={name: COLOURS[name] for name in names},
            region=_REGION,
            width_m=_WIDTHS,
            height_m=_HEIGHTS,
            gap_m=_GAP,
        )
        others = [gripping.obstacle(as_seen(body)) for body in bodies[1:]]
        grip = gripping.grip(as_seen(bodies[0]), others)
        place = draw_place(rng, gripping, grip, others) if isinstance(grip, Grip) else None
        if place is not None:
            return GraspTask(World(bodies=bodies), target, place)
    raise InputError(f"{robot.name} can grasp nothing of what was drawn; give another robot")
