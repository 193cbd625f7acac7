"""Elements of a body: gradients of the shape functions in the reference state, and the modes of the pressure.

The pressure is discontinuous from element to element and one degree lower than the strain: constant in six-node
triangles and ten-node tetrahedra, linear in nine-node quadrilaterals and 27-node hexahedra. The linear one is linear in
the coordinates of space, not in those of the reference cell: on cells that are no parallelograms only the former keeps
the optimal order (Boffi and Gastaldi 2002).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem import kernels
from turgor.fem.section import Axisymmetric, Section, depth
from turgor.mesh.cells import Cell

Floats = NDArray[np.float64]


def reference_gradients(nodes: Floats, cell: Cell, section: Section | None) -> tuple[Floats, Floats]:
    """Return the gradients of the shape functions and the volumes at the quadrature points.

    Parameters
    ----------
    nodes
        Reference positions of the nodes of each element, ``(m, n, d)``.
    cell
        The kind of the elements.
    section
        What a plane mesh stands for.

    Returns
    -------
    G
        ``(m, q, 3, n)``. In a plane mesh the third row is the gradient across the plane of the displacement along x:
        N/R in a body of revolution, where a radial displacement stretches the circumference, else zero.
    dV
        ``(m, q)``, mm³.
    """
    G, dV = np.zeros((len(nodes), len(cell.weights), 3, cell.n_nodes)), np.empty((len(nodes), len(cell.weights)))
    kernels.reference_gradients(nodes, cell.gradient_at_quadrature, cell.weights, G, dV)
    if section is None:
        return G, dV
    places = cell.shape_at_quadrature @ nodes
    if isinstance(section, Axisymmetric):
        G[:, :, 2] = cell.shape_at_quadrature / places[:, :, :1]
    return G, dV * depth(section, places)


def pressure_modes(nodes: Floats, cell: Cell, dV: Floats) -> Floats:
    """Return the modes ψ_k of the pressure at the quadrature points, ``(m, q, k)``.

    They are orthonormal, ``∫ ψ_k ψ_l dV = V δ_kl``, and the first one is 1. `nodes` are ``(m, n, d)``, `dV` ``(m, q)``.
    """
    share = dV / dV.sum(axis=1, keepdims=True)
    constant = np.ones((*dV.shape, 1))
    if cell.simplex:
        return constant
    places = cell.shape_at_quadrature @ nodes
    places = places - np.einsum("mq,mqi->mi", share, places)[:, None]
    places /= np.ptp(nodes, axis=1).max(axis=1)[:, None, None]
    moments = np.einsum("mq,mqi,mqj->mij", share, places, places)
    whitening = np.linalg.inv(np.linalg.cholesky(moments)).swapaxes(-1, -2)
    return np.ascontiguousarray(np.concatenate([constant, places @ whitening], axis=2))
