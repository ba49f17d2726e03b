"""L5: what watches a run: energies, probes, crack tips, the NaN guard, output, progress. They hang on run.py and never feed back into motion."""
