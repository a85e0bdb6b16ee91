"""One environment in several layouts: written as a cube cross, read back, turned, asked for its light."""

import numpy as np

import gonio as gn

room = gn.studio(128)
gn.write_environment("05_cross.exr", room, gn.CubeCross(), rows=256)
cross = gn.read_environment("05_cross.exr")
print(type(cross.mapping).__name__, cross.orientation.name)

up = gn.normalise([[0.2, 0.1, 1.0], [1.0, 0.0, 0.1]])
print("nine coefficients of both differ by", np.abs(cross.harmonics(2) - room.harmonics(2)).max())

quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
print(
    "turned with its orientation, no pixel resampled:",
    room.rotated(quarter).radiance(up @ quarter.T) - room.radiance(up),
)
