"""Texts of results in a console (`ShortRepr`): shapes of arrays in place of their numbers."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

LONGEST = 60


class ShortRepr:
    """Of a dataclass with `repr=False`: each field in at most 60 characters."""

    def __repr__(self) -> str:
        own: Any = self
        texts = (f"{one.name}={_short(getattr(self, one.name))}" for one in fields(own) if one.repr)
        return f"{type(self).__name__}({', '.join(texts)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<{'x'.join(map(str, value.shape))} {value.dtype}>"
    text = repr(value)
    if len(text) <= LONGEST:
        return text
    return (
        f"<{len(value)} in a {type(value).__name__}>" if hasattr(value, "__len__") else f"{text[:LONGEST]}..."
    )
