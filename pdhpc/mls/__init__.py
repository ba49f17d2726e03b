"""Modified moving least squares: fields and their gradients at any points, from particles whose bonds may be broken."""
