"""From sensors that send to joint angles, while the athlete moves."""

import lazy_loader

# A name loads its module when it is first used: a client needs neither decoders nor a tracker.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
