"""L4: linear elasticity over the whole body in a partition-of-unity space, enriched by local peridynamics where material fails (Schweitzer, Wu)."""
