"""Reading the numbers of a URDF strictly: what is not a plain decimal number is a problem."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from arm3dof.errors import Problem
from arm3dof.state import Array

LARGEST = 1e18
"""Largest magnitude that a number may have: products of a few such numbers still fit a float."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class NumberReader:
    """Reads numeric attributes and collects what is wrong with them.

    An unreadable number is returned as NaN, so that reading goes on and finds every problem.
    Readable attributes are rewritten tidily in the element (single spaces, none at the ends),
    because Pinocchio's reader takes ``" 1"`` for zero.

    Attributes:
        problems: everything noted so far.
    """

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def note(self, where: str, what: str, cure: str) -> None:
        """Add a problem."""
        self.problems.append(Problem(where, what, cure))

    def number(self, element: Element | None, key: str, where: str, tag: str) -> float:
        """Return a number that must be there; ``tag`` names the element for the message."""
        if element is None or key not in element.attrib:
            self.note(where, f"<{tag}> has no {key}", f'write <{tag} {key}="..."/>')
            return float("nan")
        return float(self._numbers(element, key, where, 1)[0])

    def optional(self, element: Element | None, key: str, where: str, default: float) -> float:
        """Return a number, or ``default`` where the file gives none."""
        return float(self.vector(element, key, where, (default,))[0])

    def vector(
        self, element: Element | None, key: str, where: str, default: Sequence[float]
    ) -> Array:
        """Return as many numbers as ``default`` has, or ``default`` where the file gives none."""
        if element is None or key not in element.attrib:
            values = np.array(default)
        else:
            values = self._numbers(element, key, where, len(default))
        values.flags.writeable = False
        return values

    def origin(self, parent: Element, where: str) -> tuple[Array, Array]:
        """Return ``xyz`` [m] and ``rpy`` [rad] of the element's <origin>, zeros without one."""
        origin = parent.find("origin")
        if origin is not None and "quat_xyzw" in origin.attrib:
            self.note(where, "origin quat_xyzw is not supported", "give the orientation as rpy")
        zeros = (0.0, 0.0, 0.0)
        return self.vector(origin, "xyz", where, zeros), self.vector(origin, "rpy", where, zeros)

    def _numbers(self, element: Element, key: str, where: str, count: int) -> Array:
        text = element.get(key, "")
        words = text.split()
        name = f"<{element.tag}> {key}"
        if len(words) != count or not all(_NUMBER.fullmatch(word) for word in words):
            wanted = "a number" if count == 1 else f"{count} numbers"
            cure = f"write {wanted} such as {' '.join(['0.5'] * count)}"
            if "," in text:
                cure += ", with a point and not a comma"
            self.note(where, f'{name} "{text}" is not {wanted}', cure)
            return np.full(count, np.nan)
        values = [float(word) for word in words]
        if any(abs(value) > LARGEST for value in values):
            self.note(where, f'{name} "{text}" is beyond {LARGEST:g}', "give a number in SI units")
            return np.full(count, np.nan)
        element.set(key, " ".join(words))
        return np.array(values)
