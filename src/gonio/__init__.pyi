from .brdf.diffuse import Lambert as Lambert
from .errors import GonioError as GonioError
from .errors import GonioWarning as GonioWarning
from .sphere.grids import GaussLegendre as GaussLegendre
from .sphere.grids import LatLong as LatLong
from .sphere.harmonics import complex_harmonics as complex_harmonics
from .sphere.harmonics import harmonics as harmonics
from .sphere.harmonics import power_spectrum as power_spectrum
