"""L0: communicators, ghosts, partition. The only place, with fem/, output/, run.py and cli.py, where MPI or PETSc is imported."""
