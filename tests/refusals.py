"""A call that must be refused, and what the refusal must say."""

from collections.abc import Callable

import pytest

from oarlock import DataError


def assert_refused(call: Callable[[], object], *words: str, error: type[Exception] = DataError) -> None:
    """The call raises the error, and its text contains all words."""
    with pytest.raises(error) as caught:
        call()
    text = str(caught.value)
    assert [word for word in words if word not in text] == [], text
