"""L2: finite elements: the distributed mesh of the whole body, its elements, and linear elasticity on them."""
