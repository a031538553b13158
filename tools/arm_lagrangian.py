"""The Lagrangian (16)-(17) of the paper's arm in sympy, and the sums over links that it depends on.

The link transforms (3) give each centroid's velocity and each link's angular velocity, these the
energies. Sines and cosines of the joint angles are symbols of their own (``s23`` for
sin(theta2 + theta3)), with their own rules for derivatives, so that every expression is a
polynomial with one normal form.
"""

from __future__ import annotations

import sympy as sp

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
