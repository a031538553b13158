"""Print symbolic dynamics as Python that people can read.

Each coefficient is recognised as a product of sines and cosines; what belongs to one part of the
arm makes one line, and nothing is computed twice.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product

import sympy as sp
from arm_lagrangian import (
    A2,
    C1,
    C2,
    C23,
    GRAVITY,
    H1,
    H2,
    H3,
    J1,
    J2,
    J3,
    S1,
    S2,
    S23,
    in_lumps,
    normal,
    slope,
)

# ---- coefficients ------------------------------------------------------------------------------


def recognised() -> dict[sp.Expr, tuple[sp.Rational, tuple[str, ...]]]:
    """Return known coefficients: normal form -> number and the factors to print."""
    singles = {"s2": S2, "c2": C2, "s23": S23, "c23": C23}
    forms: dict[tuple[str, ...], sp.Expr] = {(): sp.Integer(1)}
    forms |= {(name,): symbol for name, symbol in singles.items()}
    forms |= {("c3",): C2 * C23 + S2 * S23, ("s3",): C2 * S23 - S2 * C23}
    for one, two in product(singles, singles):
        if list(singles).index(one) <= list(singles).index(two):
            forms[one, two] = singles[one] * singles[two]
    forms["(c2 * c2 - s2 * s2)",] = C2**2 - S2**2
    forms["(c23 * c23 - s23 * s23)",] = C23**2 - S23**2
    forms["(c2 * c23 - s2 * s23)",] = C2 * C23 - S2 * S23
    forms["(s2 * c23 + c2 * s23)",] = S2 * C23 + C2 * S23
    known: dict[sp.Expr, tuple[sp.Rational, tuple[str, ...]]] = {}
    for scale, (factors, form) in product((1, -1, 2, -2), forms.items()):
        known.setdefault(normal(scale * form), (sp.Rational(scale), factors))
    return known


KNOWN = recognised()

# ---- printing ----------------------------------------------------------------------------------

Term = tuple[sp.Rational, tuple[str, ...]]  # a number and its factors
Line = tuple[str, str]  # a name and the expression that it is given
FORWARD, LEFT = sp.symbols("g_forward g_left", real=True)
ALONG = dict(zip((2, 3), sp.symbols("g_along2 g_along3", real=True), strict=True))
ACROSS = dict(zip((2, 3), sp.symbols("g_across2 g_across3", real=True), strict=True))
LOCALS = {FORWARD, LEFT, *ALONG.values(), *ACROSS.values()}
PARTS = ("link1", "link2", "link3", "elbow")
ORDER = ((2, 2), (1, 2), (1, 1), (0, 2), (0, 1), (0, 0))  # the simplest elements first


def part_of(names: Sequence[str]) -> str:
    """Return the part of the arm that a product of lumped symbols belongs to."""
    if "p.a2" in names:
        return "elbow"
    return "link" + next(name[3] for name in names if name[2] in "Jh")


def split(expression: sp.Expr) -> dict[str, list[Term]]:
    """Split a normal form into printable terms, by part of the arm."""
    atoms = [*J1, *J2, *J3, *H1, *H2, *H3, A2, GRAVITY[2], *sorted(LOCALS, key=str)]
    atoms = [atom for atom in dict.fromkeys(atoms) if expression.has(atom)]
    parts: dict[str, list[Term]] = {}
    for powers, coefficient in sp.Poly(expression, *atoms).terms():
        number, trig = KNOWN[sp.expand(coefficient)]
        names = [
            str(atom) if atom in LOCALS else f"p.{atom}"
            for atom, power in zip(atoms, powers, strict=True)
            for _ in range(power)
        ]
        parts.setdefault(part_of(names), []).append((number, (*names, *trig)))
    return {part: sorted(parts[part], key=lambda t: t[1]) for part in PARTS if part in parts}


def scaled(number: sp.Rational, factors: Sequence[str]) -> str:
    """Write a product; a number of one is left out."""
    sign = "-" if number < 0 else ""
    head = [] if abs(number) == 1 and factors else [f"{float(abs(number))}"]
    return sign + " * ".join([*head, *factors])


def written(terms: Sequence[Term]) -> str:
    """Write a sum of terms, with what they have in common taken out."""
    if len(terms) == 1:
        return scaled(*terms[0])
    shared = [f for f in terms[0][1] if all(f in factors for _, factors in terms)]
    numbers = {abs(number) for number, _ in terms}
    common = numbers.pop() if len(numbers) == 1 else sp.Integer(1)
    if all(number < 0 for number, _ in terms):
        common = -common
    text = ""
    for number, factors in terms:
        rest = list(factors)
        for factor in shared:
            rest.remove(factor)
        item = scaled(number / common, rest)
        text += (f" - {item[1:]}" if item[0] == "-" else f" + {item}") if text else item
    return text if common == 1 and not shared else scaled(common, [*shared, f"({text})"])


class Listing:
    """Assignments in the order in which they are computed; nothing is computed twice."""

    def __init__(self) -> None:
        self.lines: list[Line] = []
        self._known: dict[str, str] = {}

    def add(self, name: str, text: str) -> None:
        """Append an assignment and remember what it and its double are."""
        self.lines.append((name, text))
        if text.startswith("p.") and " " not in text:
            return
        double = text.removeprefix("-")
        sign = "-" if text.startswith("-") else ""
        self._known[text] = name
        self._known[f"{sign}2.0 * {double}"] = f"2.0 * {name}"

    def add_element(self, name: str, expression: sp.Expr) -> None:
        """Append what computes a normal form, part by part."""
        parts = {part: written(terms) for part, terms in split(expression).items()}
        if len(parts) == 1:
            text = next(iter(parts.values()))
            self.add(name, self._known.get(text, text))
            return
        addends = []
        for part, text in parts.items():
            if text not in self._known and " " in text:
                self.add(f"{name}_{part}", text)
            addends.append(self._known.get(text, text))
        self.add(name, " + ".join(addends))


def mass_lines(mass: sp.Matrix) -> list[Line]:
    """Return the assignments for the upper triangle of M."""
    listing = Listing()
    for i, j in ORDER:
        listing.add_element(f"m{i + 1}{j + 1}", mass[i, j])
    return listing.lines


def christoffel_lines(mass: sp.Matrix) -> list[Line]:
    """Return the assignments for N, here the matrix of M's Christoffel symbols.

    ``m12_3`` stands for the derivative of m12 by theta3; what is zero, or a multiple of another
    derivative, is not computed again.
    """
    listing = Listing()
    slopes: dict[tuple[int, int, int], sp.Expr] = {}
    seen: dict[sp.Expr, sp.Expr] = {sp.Integer(0): sp.Integer(0)}
    for (i, j), k in product(ORDER, (2, 1, 0)):
        change = normal(slope(mass[i, j], k))
        if change not in seen:
            name = f"m{i + 1}{j + 1}_{k + 1}"
            listing.add_element(name, change)
            for scale in (1, 2):
                seen.setdefault(sp.expand(change * scale), scale * sp.Symbol(name))
        slopes[i, j, k] = slopes[j, i, k] = seen[change]
    speeds = sp.symbols("v1:4")
    for i, j in product(range(3), range(3)):
        symbols = [slopes[i, j, k] + slopes[i, k, j] - slopes[j, k, i] for k in range(3)]
        element = sp.expand(sum(s * v for s, v in zip(symbols, speeds, strict=True)) / 2)
        terms = [
            (number, tuple(sorted(map(str, rest.free_symbols))))
            for rest, number in element.as_coefficients_dict().items()
        ]
        ordered = sorted(terms, key=lambda term: term[1][::-1])
        listing.lines.append((f"n{i + 1}{j + 1}", written(ordered)))
    return listing.lines


def gravity_lines(potential: sp.Expr) -> list[Line]:
    """Return the assignments for g, the slope of the potential energy.

    Gravity is first turned into the arm's plane (forward, left, and up), then along each link.
    """
    listing = Listing()
    listing.lines += [
        ("g_forward", "p.g_x * c1 + p.g_y * s1"),
        ("g_left", "p.g_y * c1 - p.g_x * s1"),
    ]
    for i, angle in ((2, "2"), (3, "23")):
        listing.lines += [
            (str(ALONG[i]), f"g_forward * c{angle} + p.g_z * s{angle}"),
            (str(ACROSS[i]), f"p.g_z * c{angle} - g_forward * s{angle}"),
        ]
    level = {GRAVITY[0]: C1 * FORWARD - S1 * LEFT, GRAVITY[1]: S1 * FORWARD + C1 * LEFT}
    for i in (2, 1, 0):
        torque = in_lumps(normal(slope(potential, i).subs(level)))
        if i > 0:
            torque = normal(along_links(torque))
        listing.add_element(f"g{i + 1}", torque)
    return listing.lines


def along_links(torque: sp.Expr) -> sp.Expr:
    """Rewrite a torque by the components of gravity along and across each link."""
    total = sp.Integer(0)
    for i, moment, sine, cosine in ((2, H2, S2, C2), (3, H3, S23, C23)):
        share = sum(symbol * torque.coeff(symbol) for symbol in moment)
        forward = cosine * ALONG[i] - sine * ACROSS[i]
        up = sine * ALONG[i] + cosine * ACROSS[i]
        total += share.subs({FORWARD: forward, GRAVITY[2]: up}, simultaneous=True)
    return total


# ---- the module --------------------------------------------------------------------------------

HEADER = (
    '"""The closed-form dynamics (19) of the paper\'s arm, as sums over its links.'
    + """

Written by tools/derive_closed_form.py, which derives them by the Lagrangian (16)-(18) and proves
every line; change that script, not this file.

Angles are those of the DH chain: ``s2`` is sin(theta2), ``c23`` is cos(theta2 + theta3).
\"\"\"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.state import Array


class Lumped(NamedTuple):
    \"\"\"The sums over the links that the dynamics depend on.

    ``J`` are second moments (elements of the inertia matrix, so J_xy is minus the integral of
    x y dm) [kg m^2] and ``h`` first moments (mass times centroid) [kg m] about the origin and
    along the axes of the link's own DH frame, at its near end. The numbers are the links'. Link 2
    carries the mass of link 3 at the elbow: h2_x contains m3 a2, J2_yy and J2_zz contain m3 a2^2,
    J2_xz contains -a2 h3_z. ``g`` is gravity in DH frame 0 [m/s^2] and ``a2`` the upper arm [m].
    \"\"\"

"""
)

FUNCTIONS = (
    ("mass_matrix", "theta: Array", "M", "m", """Return M of (19).

    ``mIJ_link2`` is what link 2 adds to the element I, J; ``elbow`` is what the forearm's first
    moment at the end of the upper arm adds.

    Args:
        p: the arm.
        theta: DH angles, shape (..., 3) [rad].

    Returns:
        Symmetric matrices, shape (..., 3, 3) [kg m^2].
    """),
    ("coriolis", "theta: Array, v: Array", "N", "n", """Return N of (19): M's Christoffel symbols.

    ``mIJ_K`` is the derivative of M's element I, J by theta K.

    Args:
        p: the arm.
        theta: DH angles, shape (..., 3) [rad].
        v: their rates, shape (..., 3) [rad/s].

    Returns:
        Matrices, shape (..., 3, 3) [kg m^2/s], with dM/dt - 2 N skew-symmetric.
    """),
    ("gravity", "theta: Array", "g", "g", """Return g of (19), for gravity in any direction.

    ``g_forward`` and ``g_left`` are gravity's components in the arm's vertical plane and across
    it, ``g_along2`` and ``g_across2`` those along x and y of frame 2.

    Args:
        p: the arm.
        theta: DH angles, shape (..., 3) [rad].

    Returns:
        Torques that hold the arm still, shape (..., 3) [N m].
    """),
)  # fmt: skip


def angle_lines(lines: Sequence[Line]) -> list[str]:
    """Return the code that computes the sines, cosines and speeds that the lines use."""
    used = set(re.findall(r"\b[a-z]+[0-9]+\b", " ".join(text for _, text in lines)))
    angles = {"1": "theta[..., 0]", "2": "theta[..., 1]", "3": "theta[..., 2]"}
    angles["23"] = "theta[..., 1] + theta[..., 2]"
    code = []
    for index, angle in angles.items():
        for name, function in ((f"s{index}", "sin"), (f"c{index}", "cos")):
            if name in used:
                code.append(f"{name} = np.{function}({angle})")
    code += [f"v{i + 1} = v[..., {i}]" for i in range(3) if f"v{i + 1}" in used]
    return code


def indented(line: str) -> str:
    """Return a line of a function's body; one that is too long is broken at its bracket."""
    if len(line) + 4 <= 100:
        return f"    {line}"
    head, inner = line.removesuffix(")").split("(", 1)
    return f"    {head}(\n        {inner}\n    )"


def function_code(
    name: str, arguments: str, out: str, letter: str, doc: str, lines: Sequence[Line]
) -> str:
    """Return the text of one function of the module."""
    code = [f"def {name}(p: Lumped, {arguments}) -> Array:", f'    """{doc}"""']
    body = [*angle_lines(lines), *(f"{left} = {right}" for left, right in lines)]
    if letter == "g":
        body.append(f"{out} = np.empty(theta.shape)")
        body += [f"{out}[..., {i}] = g{i + 1}" for i in range(3)]
    else:
        body.append(f"{out} = np.empty((*theta.shape, 3))")
        for i, j in product(range(3), range(3)):
            pair = sorted((i, j)) if letter == "m" else (i, j)
            body.append(f"{out}[..., {i}, {j}] = {letter}{pair[0] + 1}{pair[1] + 1}")
    return "\n".join([*code, *(indented(line) for line in body), f"    return {out}"])


def module_text(listings: Sequence[Sequence[Line]]) -> str:
    """Return the text of the module that computes M, N and g by the given lines."""
    texts = " ".join(text for lines in listings for _, text in lines)
    fields = dict.fromkeys(["a2", *sorted(set(re.findall(r"p\.(\w+)", texts)))])
    header = HEADER + "\n".join(f"    {field}: float" for field in fields)
    functions = [
        function_code(*spec, lines) for spec, lines in zip(FUNCTIONS, listings, strict=True)
    ]
    return "\n\n\n".join([header, *functions]) + "\n"
