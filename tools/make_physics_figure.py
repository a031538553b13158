"""Draw docs/images/physics.jpg: the physics world as a camera in it sees it, in mid-lift."""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

import arm3dof
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.scatter import scatter
from arm3dof.sim.world import COLOURS, Bin, World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.vision.camera import intrinsics, look_at

IMAGE = Path(__file__).resolve().parent.parent / "docs" / "images" / "physics.jpg"
TRAYS = (("red", 0.02, 0.19), ("green", 0.02, -0.19), ("blue", -0.10, -0.19))
WIDTH, HEIGHT = 1280, 800


def main() -> None:
    """Grip one of nine objects, lift it, and photograph the table twice as large as needed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=IMAGE)
    arguments = parser.parse_args()
    robot = arm3dof.load_robot("arm3dof")
    colours = {name: COLOURS[name] for name, _, _ in TRAYS}
    bins = tuple(Bin(name, x, y, (0.045, 0.045), colours[name]) for name, x, y in TRAYS)
    bodies = scatter(np.random.default_rng(7), 9, colours=colours, bins=bins, gap_m=0.018)
    plant = MujocoPlant(robot, World(bodies=bodies, bins=bins))
    lift(robot, plant, max(bodies, key=lambda body: body.x).name)
    camera = WorldCamera(
        plant,
        intrinsics(2900.0, 2900.0, WIDTH - 0.5, HEIGHT - 0.5),
        look_at([0.64, 0.30, 0.27], [0.085, -0.005, -0.07]),
        2 * WIDTH,
        2 * HEIGHT,
    )
    with camera:
        picture = cv2.resize(camera.take(), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(arguments.out), picture, [cv2.IMWRITE_JPEG_QUALITY, 88])
    print(f"wrote {arguments.out}, {arguments.out.stat().st_size / 1024:.0f} KiB")


def lift(robot: arm3dof.Robot, plant: MujocoPlant, name: str) -> None:
    """Grip an object where it stands and lift it by 8 cm."""
    body, controller = plant.world.body(name), arm3dof.MpcController(robot)
    height = -0.11 + max(body.height_m / 2, 0.022)
    low = arm3dof.inverse_kinematics(robot, [body.x, body.y, height]).best
    high = arm3dof.inverse_kinematics(robot, [body.x, body.y, height + 0.08], near=low).best
    plant.reset(arm3dof.JointState(0.0, low, np.zeros(3)))
    plant.command_gripper(0.0)
    for target, duration in ((low, 0.7), (high, 1.5)):
        for step in range(round(duration / plant.dt)):
            if step % round(controller.dt / plant.dt) == 0:
                tau = controller.step(plant.measure(), target).tau
            plant.step(tau)


if __name__ == "__main__":
    main()
