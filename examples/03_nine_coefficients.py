"""Irradiance from nine numbers (RH 4), beside the full integral."""

import numpy as np

import gonio as gn

room = gn.studio(64)
light = room.harmonics(2)  # (9, 3): L00, L1-1, L10, L11, L2-2, L2-1, L20, L21, L22
normals = gn.LatLong(16, 32).directions()

nine = gn.irradiance(light, normals)

beams = room.beams()  # one for each texel
full = np.maximum(normals @ beams.directions.T, 0) @ beams.irradiance
error = np.abs(nine - full) / beams.irradiance.sum(axis=0)
print(f"nine coefficients miss the integral by {error.mean():.2%} on average, {error.max():.2%} at most")

# For a shader: E(n) = [n; 1]^T M [n; 1], one 4 x 4 matrix a channel (RH 4.15).
print(np.round(gn.irradiance_matrix(light)[1], 3))
