"""L1: materials. A material is a frozen class of validated parameters and one law inlined into the kernels."""
