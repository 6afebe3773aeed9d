"""A verb whose options are known only at run time: Typer reads them from the signature. For the verbs of import."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import Parameter, Signature
from typing import Any

from oarlock.cli.terminal import verb


def made_verb(function: Callable[..., None], wanted: Sequence[tuple[str, Any, Any]]) -> Callable[..., None]:
    """The function as a verb.

    Args:
        function: takes every option as a keyword.
        wanted: name, annotation and default of each argument and option; `...` for no default.
    """
    function.__signature__ = Signature(  # type: ignore[attr-defined]
        [
            Parameter(
                name,
                Parameter.KEYWORD_ONLY,
                annotation=kind,
                default=Parameter.empty if default is ... else default,
            )
            for name, kind, default in wanted
        ]
    )
    return verb(function)
