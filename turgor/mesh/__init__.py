"""Meshes: generation by gmsh, named regions and surfaces, quality."""

from turgor.mesh.mesh import Mesh

__all__ = ["Mesh"]
