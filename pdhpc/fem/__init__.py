"""L2: finite elements on a distributed mesh: linear elasticity, explicit, implicit and static."""
