"""L5: the scene language.

schema.py (with fields, shapes, loads) says what is valid, rules.py (with overlap) what holds between keys, read.py (with overrides, sentences, vocabulary)
reads a scene, explain.py explains it, build.py turns it into objects.
"""
