"""L5: the scene language. schema.py says what is valid, read.py reads it, explain.py explains it, build.py turns it into objects."""
