"""Functions on the sphere as coefficients: there and back, turned, and their energy by degree."""

import numpy as np

import gonio as gn

grid = gn.GaussLegendre(degree=12)
w = grid.directions()
lobe = np.exp(8 * (w @ gn.normalise([1.0, 1.0, 1.0]) - 1))

coefficients = gn.analysis(lobe, grid, degree=12)
back = gn.synthesis(coefficients, grid)
print("what degree 12 leaves out:", np.abs(back - lobe).max())

turned = gn.rotate(coefficients, gn.euler(0.3, 1.0, -0.5))
print("a turn keeps the energy of each degree:", np.ptp(gn.power_spectrum(turned) / gn.power_spectrum(coefficients)))
