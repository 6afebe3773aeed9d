"""Oarlock tracks articulated bodies from wearable and mounted sensors, and says how sure it is.

`__init__.pyi` has all public names.
"""

import importlib

from oarlock.storage.extras import public_names

# A name loads its module when it is first used: most programs need few of them.
_public_name, __dir__, __all__ = public_names(__name__, __file__)


ROOMS = {"oarlock.live", "oarlock.movement", "oarlock.rowing", "oarlock.season"}
"""Fields of use: at hand after `import oarlock`, as the rooms of `__init__.pyi` are."""


def __getattr__(name: str) -> object:
    # Fields of use stand above this room, so no import names them.
    room = f"oarlock.{name}"
    return importlib.import_module(room) if room in ROOMS else _public_name(name)


def _config_from_dict(keys: dict[str, object]) -> object:
    """Unpickle a Config."""
    return __getattr__("Config")(**keys)
