"""L1: files a run leaves: fields (HDF5, XDMF), history.csv, run.json, pictures. A kill at any moment leaves the last complete state readable."""
