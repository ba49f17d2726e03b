"""L6: studies of runs: estimates, verification."""
