"""L2: particles, bonds, the part of the body one rank owns, and its integrator. Arrays and handles only, never a communicator."""
