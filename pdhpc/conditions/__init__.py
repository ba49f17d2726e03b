"""L1: time functions, and the loads and prescribed motions that follow them."""
