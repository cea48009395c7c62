"""Solids of one-point hexahedra (C3D8R): laws, meshes, steps, equilibrium."""
