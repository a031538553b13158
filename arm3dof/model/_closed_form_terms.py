"""The closed-form dynamics (19) of the paper's arm, as sums over its links.

Written by tools/derive_closed_form.py, which derives them by the Lagrangian (16)-(18) and proves
every line; change that script, not this file.

Angles are those of the DH chain: ``s2`` is sin(theta2), ``c23`` is cos(theta2 + theta3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm3dof.state import Array


class Lumped(NamedTuple):
    """The sums over the links that the dynamics depend on.

    ``J`` are second moments (elements of the inertia matrix, so J_xy is minus the integral of
    x y dm) [kg m^2] and ``h`` first moments (mass times centroid) [kg m] about the origin and
    along the axes of the link's own DH frame, at its near end. The numbers are the links'. Link 2
    carries the mass of link 3 at the elbow: h2_x contains m3 a2, J2_yy and J2_zz contain m3 a2^2,
    J2_xz contains -a2 h3_z. ``g`` is gravity in DH frame 0 [m/s^2] and ``a2`` the upper arm [m].
    """

    a2: float
    J1_zz: float
    J2_xx: float
    J2_xy: float
    J2_xz: float
    J2_yy: float
    J2_yz: float
    J2_zz: float
    J3_xx: float
    J3_xy: float
    J3_xz: float
    J3_yy: float
    J3_yz: float
    J3_zz: float
    g_x: float
    g_y: float
    g_z: float
    h1_x: float
    h1_y: float
    h2_x: float
    h2_y: float
    h2_z: float
    h3_x: float
    h3_y: float
    h3_z: float


def mass_matrix(p: Lumped, theta: Array) -> Array:
    """Return M of (19).

    ``mIJ_link2`` is what link 2 adds to the element I, J; ``elbow`` is what the forearm's first
    moment at the end of the upper arm adds.

    Args:
        p: the arm.
        theta: DH angles, shape (..., 3) [rad].

    Returns:
        Symmetric matrices, shape (..., 3, 3) [kg m^2].
    """
    s2 = np.sin(theta[..., 1])
    c2 = np.cos(theta[..., 1])
    s3 = np.sin(theta[..., 2])
    c3 = np.cos(theta[..., 2])
    s23 = np.sin(theta[..., 1] + theta[..., 2])
    c23 = np.cos(theta[..., 1] + theta[..., 2])
    m33 = p.J3_zz
    m23_elbow = p.a2 * (p.h3_x * c3 - p.h3_y * s3)
    m23 = p.J3_zz + m23_elbow
    m22 = p.J2_zz + p.J3_zz + 2.0 * m23_elbow
    m13 = p.J3_xz * s23 + p.J3_yz * c23
    m12_link2 = p.J2_xz * s2 + p.J2_yz * c2
    m12 = m12_link2 + m13
    m11_link2 = p.J2_xx * s2 * s2 + 2.0 * p.J2_xy * s2 * c2 + p.J2_yy * c2 * c2
    m11_link3 = p.J3_xx * s23 * s23 + 2.0 * p.J3_xy * s23 * c23 + p.J3_yy * c23 * c23
    m11_elbow = 2.0 * p.a2 * c2 * (p.h3_x * c23 - p.h3_y * s23)
    m11 = p.J1_zz + m11_link2 + m11_link3 + m11_elbow
    M = np.empty((*theta.shape, 3))
    M[..., 0, 0] = m11
    M[..., 0, 1] = m12
    M[..., 0, 2] = m13
    M[..., 1, 0] = m12
    M[..., 1, 1] = m22
    M[..., 1, 2] = m23
    M[..., 2, 0] = m13
    M[..., 2, 1] = m23
    M[..., 2, 2] = m33
    return M


def coriolis(p: Lumped, theta: Array, v: Array) -> Array:
    """Return N of (19): M's Christoffel symbols.

    ``mIJ_K`` is the derivative of M's element I, J by theta K.

    Args:
        p: the arm.
        theta: DH angles, shape (..., 3) [rad].
        v: their rates, shape (..., 3) [rad/s].

    Returns:
        Matrices, shape (..., 3, 3) [kg m^2/s], with dM/dt - 2 N skew-symmetric.
    """
    s2 = np.sin(theta[..., 1])
    c2 = np.cos(theta[..., 1])
    s3 = np.sin(theta[..., 2])
    c3 = np.cos(theta[..., 2])
    s23 = np.sin(theta[..., 1] + theta[..., 2])
    c23 = np.cos(theta[..., 1] + theta[..., 2])
    v1 = v[..., 0]
    v2 = v[..., 1]
    v3 = v[..., 2]
    m23_3 = -p.a2 * (p.h3_x * s3 + p.h3_y * c3)
    m13_3 = p.J3_xz * c23 - p.J3_yz * s23
    m12_2_link2 = p.J2_xz * c2 - p.J2_yz * s2
    m12_2 = m12_2_link2 + m13_3
    m11_3_link3 = 2.0 * (
        p.J3_xx * s23 * c23 + p.J3_xy * (c23 * c23 - s23 * s23) - p.J3_yy * s23 * c23
    )
    m11_3_elbow = -2.0 * p.a2 * c2 * (p.h3_x * s23 + p.h3_y * c23)
    m11_3 = m11_3_link3 + m11_3_elbow
    m11_2_link2 = 2.0 * (p.J2_xx * s2 * c2 + p.J2_xy * (c2 * c2 - s2 * s2) - p.J2_yy * s2 * c2)
    m11_2_elbow = -2.0 * p.a2 * (p.h3_x * (s2 * c23 + c2 * s23) + p.h3_y * (c2 * c23 - s2 * s23))
    m11_2 = m11_2_link2 + m11_3_link3 + m11_2_elbow
    n11 = 0.5 * (m11_2 * v2 + m11_3 * v3)
    n12 = 0.5 * m11_2 * v1 + m12_2 * v2 + m13_3 * v3
    n13 = 0.5 * m11_3 * v1 + m13_3 * v2 + m13_3 * v3
    n21 = -0.5 * m11_2 * v1
    n22 = m23_3 * v3
    n23 = m23_3 * (v2 + v3)
    n31 = -0.5 * m11_3 * v1
    n32 = -m23_3 * v2
    n33 = 0.0
    N = np.empty((*theta.shape, 3))
    N[..., 0, 0] = n11
    N[..., 0, 1] = n12
    N[..., 0, 2] = n13
    N[..., 1, 0] = n21
    N[..., 1, 1] = n22
    N[..., 1, 2] = n23
    N[..., 2, 0] = n31
    N[..., 2, 1] = n32
    N[..., 2, 2] = n33
    return N


def gravity(p: Lumped, theta: Array) -> Array:
    """Return g of (19), for gravity in any direction.

    ``g_forward`` and ``g_left`` are gravity's components in the arm's vertical plane and across
    it, ``g_along2`` and ``g_across2`` those along x and y of frame 2.

    Args:
        p: the arm.
        theta: DH angles, shape (..., 3) [rad].

    Returns:
        Torques that hold the arm still, shape (..., 3) [N m].
    """
    s1 = np.sin(theta[..., 0])
    c1 = np.cos(theta[..., 0])
    s2 = np.sin(theta[..., 1])
    c2 = np.cos(theta[..., 1])
    s23 = np.sin(theta[..., 1] + theta[..., 2])
    c23 = np.cos(theta[..., 1] + theta[..., 2])
    g_forward = p.g_x * c1 + p.g_y * s1
    g_left = p.g_y * c1 - p.g_x * s1
    g_along2 = g_forward * c2 + p.g_z * s2
    g_across2 = p.g_z * c2 - g_forward * s2
    g_along3 = g_forward * c23 + p.g_z * s23
    g_across3 = p.g_z * c23 - g_forward * s23
    g3 = -p.h3_x * g_across3 + p.h3_y * g_along3
    g2_link2 = -p.h2_x * g_across2 + p.h2_y * g_along2
    g2 = g2_link2 + g3
    g1_link1 = -p.h1_x * g_left + p.h1_y * g_forward
    g1_link2 = -p.h2_x * g_left * c2 + p.h2_y * g_left * s2 - p.h2_z * g_forward
    g1_link3 = -p.h3_x * g_left * c23 + p.h3_y * g_left * s23 - p.h3_z * g_forward
    g1 = g1_link1 + g1_link2 + g1_link3
    g = np.empty(theta.shape)
    g[..., 0] = g1
    g[..., 1] = g2
    g[..., 2] = g3
    return g
