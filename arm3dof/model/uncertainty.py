"""A robot whose masses are not quite those of its model: what a controller meets in practice."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np

from arm3dof.errors import InputError
from arm3dof.model.build import robot_from_description
from arm3dof.model.robot import Robot
from arm3dof.state import Array

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def perturbed(
    robot: Robot,
    percent: float,
    *,
    rng: np.random.Generator | None = None,
    sign: float | None = None,
    centroid_percent: float | None = None,
) -> Robot:
    """Return a robot whose links are heavier or lighter, and balanced elsewhere, than the model's.

    Each link's mass and its inertia about the centre of mass are scaled by one factor, and its
    centre of mass is shifted, so that every link remains a body that could exist. The change is
    written into the URDF text of ``description``: the robot can be drawn, saved and built again.
    Lengths, limits, friction and the payload stay.

    Args:
        robot: the robot as its model states it.
        percent: largest error of masses and inertias, from 0 to below 100 [%].
        rng: draws each link's error evenly from -percent to +percent, and each coordinate of its
            centre of mass likewise.
        sign: instead of ``rng``, +1 makes every error +percent, -1 makes every one -percent.
        centroid_percent: largest error of a centre of mass, in percent of its coordinates in the
            link's frame; ``percent`` when None.

    Raises:
        InputError: a percentage is outside its range, or not exactly one of ``rng`` and ``sign``
            is given, or the sign is another number.
    """
    shift = percent if centroid_percent is None else centroid_percent
    for name, value in (("percent", percent), ("centroid_percent", shift)):
        if not 0 <= value < 100:
            raise InputError(f"{name} is {value!r}; give a number from 0 to below 100")
    if (rng is None) == (sign is None):
        raise InputError("give either rng, for errors of each link, or sign, for one of all")
    if sign not in (None, 1, -1):
        raise InputError(f"sign is {sign!r}; give +1 or -1")

    def errors(count: int) -> Array:
        return np.full(count, sign) if rng is None else rng.uniform(-1.0, 1.0, count)

    root = ElementTree.fromstring(robot.description.urdf)
    for inertial in root.iterfind("link/inertial"):
        _scale(inertial, 1 + percent / 100 * float(errors(1)[0]), 1 + shift / 100 * errors(3))
    text = ElementTree.tostring(root, encoding="unicode")
    return robot_from_description(replace(robot.description, urdf=text), robot.tool_frame)


def _scale(inertial: ElementTree.Element, mass: float, com: Array) -> None:
    """Multiply a link's mass and inertia by one factor, and its centre of mass by one an axis."""
    for element in inertial:
        if element.tag == "mass":
            _multiply(element, "value", np.array([mass]))
        elif element.tag == "inertia":
            for entry in _INERTIA:
                _multiply(element, entry, np.array([mass]))
        elif element.tag == "origin" and "xyz" in element.attrib:
            _multiply(element, "xyz", com)


def _multiply(element: ElementTree.Element, key: str, factors: Array) -> None:
    numbers = np.array([float(word) for word in element.attrib[key].split()])
    element.set(key, " ".join(repr(number) for number in (factors * numbers).tolist()))
