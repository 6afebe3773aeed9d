"""Oarlock tracks articulated bodies from wearable and mounted sensors, and says how sure it is.

Everything that is meant to be used is named in `__init__.pyi`; `oarlock.rowing` adds one field of use, `oarlock.live`
sessions with sensors that send.
"""

import importlib

import lazy_loader

# A name loads its module when it is first used: most programs need few of them.
_public_name, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    # `oarlock.live.frames` in one line after `import oarlock`; the room stands above this one, so no import names it.
    return importlib.import_module("oarlock.live") if name == "live" else _public_name(name)


def _config_from_dict(keys: dict[str, object]) -> object:
    """Unpickle a Config."""
    return __getattr__("Config")(**keys)
