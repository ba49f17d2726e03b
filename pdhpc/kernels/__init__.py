"""L1: loops over particles and bonds, compiled. Each sweep is written once; the material's law is inlined into it."""
