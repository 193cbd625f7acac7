"""Meshes: generation by gmsh, named regions and surfaces, quality."""
