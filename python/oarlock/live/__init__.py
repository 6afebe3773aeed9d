"""From sensors that send to joint angles, while the athlete moves."""

from oarlock.storage.extras import public_names

# A name loads its module when it is first used: a client needs neither decoders nor a tracker.
__getattr__, __dir__, __all__ = public_names(__name__, __file__)
