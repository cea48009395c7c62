"""Forces of one-point hexahedra (C3D8R): laws, meshes, explicit steps."""
