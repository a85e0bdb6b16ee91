"""gonio: from photographs of a known shape to reflectance and light that you can render.

    import gonio as gn

Every public name stands in `__init__.pyi`, and its module is imported when the name is first used.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
