"""Derive the closed-form dynamics (16)-(19) of the paper's arm and write them as Python.

The derivation takes the paper's way: the link transforms (3) give each centroid's velocity and
each link's angular velocity, these the Lagrangian (16), and Lagrange's equation (17) the matrices
of (18). The result is linear in a few sums over the links (``Lumped``); each of its coefficients
is recognised as a product of sines and cosines and printed by link, and the printed whole is then
proved equal to the Lagrangian's by symbolic algebra.

Run ``python tools/derive_closed_form.py`` to write ``arm3dof/model/_closed_form_terms.py``,
``--check`` to see whether the file in the repository is what this script derives.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import sympy as sp

MODULE = Path(__file__).resolve().parents[1] / "arm3dof" / "model" / "_closed_form_terms.py"

# ---- the paper's symbols -----------------------------------------------------------------------

Q = sp.symbols("q1:4", real=True)
V = sp.symbols("v1:4", real=True)
ACC = sp.symbols("a_q1:4", real=True)
A2, A3 = sp.symbols("a2 a3", positive=True)
GRAVITY = sp.Matrix(sp.symbols("g_x g_y g_z", real=True))
MASSES = sp.symbols("m1:4", positive=True)
# centroids in the frame at the far end of the link, and tensors about them: (19), (20)
CENTROIDS = [sp.Matrix(sp.symbols(f"x_c{i} y_c{i} z_c{i}", real=True)) for i in (1, 2, 3)]
PAIRS = ("xx", "xy", "xz", "yy", "yz", "zz")


def symmetric(prefix: str) -> sp.Matrix:
    """Return a symmetric 3 x 3 matrix of symbols such as ``J2_xy``."""
    entries = {pair: sp.Symbol(f"{prefix}_{pair}", real=True) for pair in PAIRS}
    return sp.Matrix(3, 3, lambda i, j: entries["".join(sorted("xyz"[i] + "xyz"[j]))])


TENSORS = [symmetric(f"I{i}") for i in (1, 2, 3)]
# what the answer is written in: second and first moments about the joints
J1, J2, J3 = (symmetric(f"J{i}") for i in (1, 2, 3))
H1, H2, H3 = (sp.Matrix(sp.symbols(f"h{i}_x h{i}_y h{i}_z", real=True)) for i in (1, 2, 3))


def near_centroids() -> list[sp.Matrix]:
    """Return the centroids in the frame of the link's own joint, at its near end."""
    return [
        c + sp.Matrix([a, 0, 0]) for c, a in zip(CENTROIDS, (sp.Integer(0), A2, A3), strict=True)
    ]


# ---- trigonometry ------------------------------------------------------------------------------

# sines and cosines of theta1, theta2 and theta2 + theta3, as the paper abbreviates them
S1, C1, S2, C2, S23, C23 = sp.symbols("s1 c1 s2 c2 s23 c23", real=True)
COSINES = {S1: C1, S2: C2, S23: C23}
JOINTS_OF = {S1: (0,), S2: (1,), S23: (1, 2)}


def abbreviated(expression: sp.Expr) -> sp.Expr:
    """Write sines and cosines of the joint angles by the abbreviations above."""
    phi = sp.Symbol("phi", real=True)
    expression = sp.expand_trig(expression.subs(Q[2], phi - Q[1]))
    for sine, angle in {S1: Q[0], S2: Q[1], S23: phi}.items():
        expression = expression.subs({sp.sin(angle): sine, sp.cos(angle): COSINES[sine]})
    return normal(expression)


def normal(expression: sp.Expr) -> sp.Expr:
    """Return the one polynomial in the abbreviations in which no sine is squared."""
    expression = sp.expand(expression)
    for sine, cosine in COSINES.items():
        reduced = sp.Integer(0)
        for (power,), factor in sp.Poly(expression, sine).terms():
            reduced += factor * (1 - cosine**2) ** (power // 2) * sine ** (power % 2)
        expression = sp.expand(reduced)
    return expression


def slope(expression: sp.Expr, joint: int) -> sp.Expr:
    """Return the derivative by a joint angle."""
    total = sp.Integer(0)
    for sine, cosine in COSINES.items():
        if joint in JOINTS_OF[sine]:
            total += sp.diff(expression, sine) * cosine - sp.diff(expression, cosine) * sine
    return total


def rate(expression: sp.Expr) -> sp.Expr:
    """Return the derivative by time, for joint speeds V."""
    return sum((slope(expression, i) * v for i, v in enumerate(V)), sp.Integer(0))


# ---- Lagrange ----------------------------------------------------------------------------------


def link_transform(a: sp.Expr, alpha: sp.Expr, d: sp.Expr, theta: sp.Expr) -> sp.Matrix:
    """Return (3)."""
    c, s, ca, sa = sp.cos(theta), sp.sin(theta), sp.cos(alpha), sp.sin(alpha)
    rows = [[c, -s, 0, a], [s * ca, c * ca, -sa, -sa * d], [s * sa, c * sa, ca, ca * d]]
    return sp.Matrix([*rows, [0, 0, 0, 1]])


def joint_frames() -> list[sp.Matrix]:
    """Return the poses of frames 1 to 3 in frame 0: the products of (4)."""
    zero = sp.Integer(0)
    t01 = link_transform(zero, zero, zero, Q[0])
    t02 = t01 * link_transform(zero, sp.pi / 2, zero, Q[1])
    t03 = t02 * link_transform(A2, zero, zero, Q[2])
    return [frame.applyfunc(abbreviated) for frame in (t01, t02, t03)]


def lagrangian() -> tuple[sp.Expr, sp.Expr]:
    """Return the kinetic and the potential energy of (16)."""
    kinetic, potential = sp.Integer(0), sp.Integer(0)
    frames = joint_frames()
    for i, (frame, centroid) in enumerate(zip(frames, near_centroids(), strict=True)):
        turn = frame[:3, :3]
        point = turn * centroid + frame[:3, 3]
        velocity = point.applyfunc(rate)
        spin = sp.zeros(3, 1)
        for k in range(i + 1):
            spin += frames[k][:3, 2] * V[k]
        spin = turn.T * spin
        kinetic += MASSES[i] * velocity.dot(velocity) / 2 + (spin.T * TENSORS[i] * spin)[0] / 2
        potential -= MASSES[i] * GRAVITY.dot(point)
    return kinetic, potential


def lagrange_equation(kinetic: sp.Expr, potential: sp.Expr) -> sp.Matrix:
    """Return the torque by (17), d/dt dL/dq' - dL/dq, with q'' as symbols."""
    lagrange = kinetic - potential
    momentum = sp.Matrix([sp.diff(lagrange, v) for v in V])
    change = momentum.jacobian(V) * sp.Matrix(ACC) + momentum.applyfunc(rate)
    return change - sp.Matrix([slope(lagrange, i) for i in range(3)])


# ---- lumping -----------------------------------------------------------------------------------


def second_moment(tensor: sp.Matrix, mass: sp.Expr, place: sp.Matrix) -> sp.Matrix:
    """Return a tensor about the joint from the one about the centroid (parallel axes)."""
    return tensor + mass * (place.dot(place) * sp.eye(3) - place * place.T)


def lumps() -> dict[sp.Symbol, sp.Expr]:
    """Return each lumped symbol as a sum over the paper's link parameters."""
    sums: dict[sp.Symbol, sp.Expr] = {}
    moments, tensors = [], []
    for tensor, mass, centroid in zip(TENSORS, MASSES, near_centroids(), strict=True):
        moments.append(mass * centroid)
        tensors.append(second_moment(tensor, mass, centroid))
    elbow = sp.Matrix([A2, 0, 0])
    # link 2 carries the mass of link 3 at the elbow, and the lever of its lateral offset
    moments[1] += MASSES[2] * elbow
    tensors[1] = second_moment(tensors[1], MASSES[2], elbow)
    lever = A2 * moments[2][2]
    tensors[1] -= sp.Matrix([[0, 0, lever], [0, 0, 0], [lever, 0, 0]])
    for symbols, values in zip((H1, H2, H3, J1, J2, J3), (*moments, *tensors), strict=True):
        sums.update(zip(symbols, values, strict=True))
    return sums


def in_lumps(expression: sp.Expr) -> sp.Expr:
    """Rewrite a normal form in the link parameters by the lumped symbols alone."""
    sums = lumps()
    for tensor, symbol in zip(TENSORS, (J1, J2, J3), strict=True):
        pairs = zip(tensor, symbol, strict=True)
        expression = expression.subs({old: new - (sums[new] - old) for old, new in pairs})
    expression = normal(expression)
    for moment, centroid in zip((H1, H2, H3), CENTROIDS, strict=True):
        solved = sp.solve([new - sums[new] for new in moment], list(centroid), dict=True)[0]
        expression = sp.expand(expression.subs(solved))
    left = expression.free_symbols & {A3, *MASSES, *(x for c in CENTROIDS for x in c)}
    if left:
        raise ArithmeticError(f"{sorted(map(str, left))} do not lump in {expression}")
    return expression


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


# ---- proof -------------------------------------------------------------------------------------


def evaluated(lines: Sequence[Line]) -> dict[str, sp.Expr]:
    """Return what the printed lines compute, in the paper's link parameters."""
    sums = {str(symbol): value for symbol, value in lumps().items()}
    values = {"a2": A2, **sums, **{str(g): g for g in GRAVITY}}
    scope: dict[str, object] = {"p": SimpleNamespace(**values)}
    scope |= {str(symbol): symbol for symbol in (*COSINES, *COSINES.values())}
    scope |= {"s3": abbreviated(sp.sin(Q[2])), "c3": abbreviated(sp.cos(Q[2]))}
    scope |= {f"v{i + 1}": v for i, v in enumerate(V)}
    computed: dict[str, sp.Expr] = {}
    for name, text in lines:
        scope[name] = computed[name] = sp.sympify(eval(text, {"__builtins__": {}}, scope))
    return computed


def prove(
    mass: Sequence[Line], coriolis: Sequence[Line], gravity: Sequence[Line], torque: sp.Matrix
) -> None:
    """Prove the printed lines: M a + N v + g is (17)'s torque, and dM/dt - 2 N is skew.

    Raises:
        ArithmeticError: they are not.
    """
    m, n, g = evaluated(mass), evaluated(coriolis), evaluated(gravity)
    m_matrix = sp.Matrix(3, 3, lambda i, j: m[f"m{min(i, j) + 1}{max(i, j) + 1}"])
    n_matrix = sp.Matrix(3, 3, lambda i, j: n[f"n{i + 1}{j + 1}"])
    g_vector = sp.Matrix([g["g1"], g["g2"], g["g3"]])
    residual = torque - m_matrix * sp.Matrix(ACC) - n_matrix * sp.Matrix(V) - g_vector
    skew = m_matrix.applyfunc(rate) - 2 * n_matrix
    paper = {GRAVITY[0]: 0, GRAVITY[1]: 0, GRAVITY[2]: -sp.Symbol("g_0")}
    claims = {
        "Lagrange's equation (17)": residual,
        "skew symmetry of dM/dt - 2 N": skew + skew.T,
        "the paper's g(q), (19)": g_vector.subs(paper) - paper_gravity(),
    }
    for claim, zero in claims.items():
        if any(normal(entry) != 0 for entry in zero):
            raise ArithmeticError(f"the printed terms do not satisfy {claim}")


def paper_gravity() -> sp.Matrix:
    """Return g(q) as the paper prints it in (19)."""
    (x2, y2, _), (x3, y3, _) = CENTROIDS[1:]
    fore = MASSES[2] * ((A3 + x3) * C23 - y3 * S23)
    upper = MASSES[2] * A2 * C2 + MASSES[1] * ((A2 + x2) * C2 - y2 * S2)
    return sp.Symbol("g_0") * sp.Matrix([0, upper + fore, fore])


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


def derive() -> str:
    """Derive and prove the dynamics; return the module's text."""
    kinetic, potential = lagrangian()
    mass = sp.hessian(kinetic, V).applyfunc(lambda entry: in_lumps(normal(entry)))
    listings = (mass_lines(mass), christoffel_lines(mass), gravity_lines(potential))
    prove(*listings, lagrange_equation(kinetic, potential))
    texts = " ".join(text for lines in listings for _, text in lines)
    fields = dict.fromkeys(["a2", *sorted(set(re.findall(r"p\.(\w+)", texts)))])
    header = HEADER + "\n".join(f"    {field}: float" for field in fields)
    functions = [
        function_code(*spec, lines) for spec, lines in zip(FUNCTIONS, listings, strict=True)
    ]
    return "\n\n\n".join([header, *functions]) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Write the module, or with ``--check`` compare it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    check = parser.parse_args(arguments).check
    text = derive()
    if not check:
        MODULE.write_text(text, encoding="utf-8")
        return 0
    if MODULE.is_file() and MODULE.read_text(encoding="utf-8") == text:
        return 0
    print(f"{MODULE}: not what {Path(__file__).name} derives; run it", file=sys.stderr)
    return 1


if __name__ == "__main__":
    raise SystemExit(main())
