from .brdf.diffuse import Lambert as Lambert
from .errors import GonioError as GonioError
from .errors import GonioWarning as GonioWarning
