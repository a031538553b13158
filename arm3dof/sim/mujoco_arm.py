"""A robot as MuJoCo bodies: the same masses, inertias, joints and shapes as its URDF states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from arm3dof.model.geometry import LinkShape, link_shapes
from arm3dof.model.gripper import Gripper
from arm3dof.model.robot import Robot
from arm3dof.model.tree import bodies
from arm3dof.model.urdf import Urdf, read_urdf
from arm3dof.sim.engine import mujoco
from arm3dof.state import Array

ROBOT, STATIC, LOOSE, SEEN = 1, 2, 4, 0
"""Collision groups: the robot, what stands still, what can be moved, and what is only seen."""

_GREY = (0.75, 0.78, 0.82, 1.0)
_END_STOP = (0.99, 0.999, 0.001, 0.5, 2.0)  # how the end of a joint's range takes up torque
FIRM = (0.004, 1.0)
"""Time constant [s] and damping ratio of contacts."""
HARD = (0.95, 0.99, 0.0005, 0.5, 2.0)
"""How contacts take up force as they are pressed in: MuJoCo's ``solimp``."""
_STICKING = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # a joint's friction: what it can hold stands still
_TORSION, _ROLLING = 0.01, 0.0001  # radius of a pad's patch against twisting, and rolling [m]
VISIBLE, _HIDDEN = 1, 3
"""Groups of shapes: cameras draw the first."""


def add_arm(spec: mujoco.MjSpec, robot: Robot, gripper: Gripper | None, grip: float) -> None:
    """Add a robot's bodies, joints and shapes to a world whose frame is the robot's base frame.

    Bodies carry the name of their first link, joints that of the URDF's joint. A robot whose
    fingers are free (``with_free_gripper``) gets them as joints.

    Args:
        spec: the world.
        robot: the robot; its inertias are taken from Pinocchio, payload included.
        gripper: its gripper, whose fingers rub more than the rest.
        grip: friction coefficient of the fingers.
    """
    urdf, _ = read_urdf(robot.description.urdf)
    if urdf is None:
        raise ValueError(f"{robot.name} has no URDF")  # a robot was built from one
    model = robot.model
    joints = {joint.name: joint for joint in urdf.joints}
    made = [spec.worldbody.add_body(name="arm_base")]
    for index in range(1, model.njoints):
        joint = joints[model.names[index]]
        place = model.jointPlacements[index]
        body = made[model.parents[index]].add_body(
            name=joint.child,
            pos=np.array(place.translation),
            quat=quaternion(place.rotation),
        )
        _set_inertia(body, model.inertias[index])
        limited = bool(np.isfinite([joint.lower, joint.upper]).all())
        slides = joint.kind == "prismatic"
        body.add_joint(
            name=joint.name,
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=joint.axis / np.linalg.norm(joint.axis),
            limited=limited,
            range=(joint.lower, joint.upper) if limited else (0.0, 0.0),
            solref_limit=FIRM,
            solimp_limit=_END_STOP,
            solref_friction=FIRM,
            solimp_friction=_STICKING,
            damping=damping(joint.damping),
            frictionloss=joint.friction,
        )
        made.append(body)
    _exclude_neighbours(spec, model, made)
    _add_shapes(spec, robot, urdf, made, set() if gripper is None else _finger_links(gripper), grip)


def set_inertias(model: mujoco.MjModel, robot: Robot) -> None:
    """Give the bodies of a compiled world the inertias of a robot with the same joints.

    Args:
        model: a model that ``add_arm`` had its part in.
        robot: the robot, its fingers free where it has a gripper.
    """
    for name, inertia in zip(robot.model.names[1:], list(robot.model.inertias)[1:], strict=True):
        body = model.jnt_bodyid[model.joint(name).id]
        moments, axes = np.linalg.eigh(np.asarray(inertia.inertia))
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        model.body_mass[body], model.body_ipos[body] = inertia.mass, inertia.lever
        model.body_inertia[body], model.body_iquat[body] = moments, quaternion(axes)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def damping(value: float) -> list[float]:
    """Return linear damping as MuJoCo's polynomial in the speed."""
    return [value, 0.0, 0.0]


def quaternion(rotation: Array) -> Array:
    """Return a rotation matrix as MuJoCo's quaternion (w, x, y, z), shape (4,)."""
    x, y, z, w = pin.Quaternion(np.asarray(rotation)).coeffs()
    return np.array([w, x, y, z])


def _finger_links(gripper: Gripper) -> set[str]:
    return {gripper.driven.link, gripper.follower.link}


def _set_inertia(body: mujoco.MjsBody, inertia: pin.Inertia) -> None:
    tensor = np.asarray(inertia.inertia)
    body.explicitinertial = True
    body.mass = inertia.mass
    body.ipos = np.array(inertia.lever)
    body.fullinertia = np.array(
        [tensor[i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    )


def _exclude_neighbours(
    spec: mujoco.MjSpec, model: pin.Model, made: Sequence[mujoco.MjsBody]
) -> None:
    """Let no link collide with the next two: their shapes are wider than what they stand for."""
    for index in range(1, model.njoints):
        parent = model.parents[index]
        near = {parent, model.parents[parent]} - {index}
        near |= {i for i in range(1, index) if model.parents[i] == parent}  # the other finger
        for other in near:
            spec.add_exclude(bodyname1=made[other].name, bodyname2=made[index].name)


# ---- shapes ------------------------------------------------------------------------------------


def _add_shapes(
    spec: mujoco.MjSpec,
    robot: Robot,
    urdf: Urdf,
    made: Sequence[mujoco.MjsBody],
    fingers: set[str],
    grip: float,
) -> None:
    """Fix the URDF's shapes to the bodies that their links belong to."""
    by_name = {body.name: body for body in made}
    home: dict[str, tuple[mujoco.MjsBody, pin.SE3]] = {}
    for body in bodies(urdf, robot.description.locked_joints):
        owner = made[0] if body.joint is None else by_name[body.joint.child]
        home |= {link.name: (owner, pose) for link, pose in body.parts}
    meshes: dict[object, str] = {}
    for role in ("visual", "collision"):
        for shape in link_shapes(robot.description, "visual" if role == "visual" else "collision"):
            owner, pose = home[shape.link]
            geom = _add_geom(spec, owner, shape, pose * shape.placement, meshes)
            if geom is None:
                continue
            if role == "visual":
                geom.contype, geom.conaffinity, geom.group = SEEN, SEEN, VISIBLE
                geom.rgba = shape.colour or _GREY
                geom.mass = 0.0
                continue
            geom.contype, geom.conaffinity, geom.group = ROBOT, ROBOT | STATIC | LOOSE, _HIDDEN
            geom.mass = 0.0
            geom.solref, geom.solimp = FIRM, HARD
            if shape.link in fingers:
                geom.condim = 4
                geom.friction = (grip, _TORSION, _ROLLING)


def _add_geom(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    shape: LinkShape,
    pose: pin.SE3,
    meshes: dict[object, str],
) -> mujoco.MjsGeom | None:
    at = {"pos": np.array(pose.translation), "quat": quaternion(pose.rotation)}
    size = np.array(shape.size)
    if shape.kind == "box":
        return body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size / 2, **at)
    if shape.kind == "sphere":
        return body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(size[0], 0, 0), **at)
    if shape.kind == "cylinder":
        half = (size[0], size[1] / 2, 0)
        return body.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=half, **at)
    name = _mesh_name(spec, shape, meshes)
    if name is None:
        return None
    return body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **at)


def _mesh_name(spec: mujoco.MjSpec, shape: LinkShape, meshes: dict[object, str]) -> str | None:
    """Return the name of a shape's mesh in the world, read once; None when it cannot be read."""
    key = (shape.file, shape.size)
    if key not in meshes:
        if shape.file is None:
            return None
        import trimesh  # a second to import, and only robots with meshes need it

        loaded: Any = trimesh.load(shape.file, force="mesh")
        mesh = spec.add_mesh(name=f"mesh_{len(meshes)}")
        mesh.uservert = (np.asarray(loaded.vertices, float) * shape.size).ravel()
        mesh.userface = np.asarray(loaded.faces, np.int32).ravel()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        meshes[key] = mesh.name
    return meshes[key]
