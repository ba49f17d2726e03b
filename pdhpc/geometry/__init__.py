"""L1: shapes, lattices that fill them, cracks that cut bonds."""
