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
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import sympy as sp
from arm_lagrangian import (
    A2,
    A3,
    ACC,
    C2,
    C23,
    CENTROIDS,
    COSINES,
    GRAVITY,
    MASSES,
    S2,
    S23,
    Q,
    V,
    abbreviated,
    in_lumps,
    lagrange_equation,
    lagrangian,
    lumps,
    normal,
    rate,
)
from arm_listing import Line, christoffel_lines, gravity_lines, mass_lines, module_text

MODULE = Path(__file__).resolve().parents[1] / "arm3dof" / "model" / "_closed_form_terms.py"


def derive() -> tuple[list[Line], list[Line], list[Line]]:
    """Return the lines that compute M, N and g, derived but not yet proved."""
    kinetic, potential = lagrangian()
    mass = sp.hessian(kinetic, V).applyfunc(lambda entry: in_lumps(normal(entry)))
    return mass_lines(mass), christoffel_lines(mass), gravity_lines(potential)


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


def prove(mass: Sequence[Line], coriolis: Sequence[Line], gravity: Sequence[Line]) -> None:
    """Prove the printed lines: M a + N v + g is (17)'s torque, and dM/dt - 2 N is skew.

    Raises:
        ArithmeticError: they are not.
    """
    m, n, g = evaluated(mass), evaluated(coriolis), evaluated(gravity)
    m_matrix = sp.Matrix(3, 3, lambda i, j: m[f"m{min(i, j) + 1}{max(i, j) + 1}"])
    n_matrix = sp.Matrix(3, 3, lambda i, j: n[f"n{i + 1}{j + 1}"])
    g_vector = sp.Matrix([g["g1"], g["g2"], g["g3"]])
    torque = lagrange_equation(*lagrangian())
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


def main(arguments: list[str] | None = None) -> int:
    """Write the module, or with ``--check`` compare it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    check = parser.parse_args(arguments).check
    listings = derive()
    prove(*listings)
    text = module_text(listings)
    if not check:
        MODULE.write_text(text, encoding="utf-8")
        return 0
    if MODULE.is_file() and MODULE.read_text(encoding="utf-8") == text:
        return 0
    print(f"{MODULE}: not what {Path(__file__).name} derives; run it", file=sys.stderr)
    return 1


if __name__ == "__main__":
    raise SystemExit(main())
