"""Makes verbs of public functions: options, their help and defaults come from signature and docstring.

An option has the parameter's name, `still_s` is `--still-s`. What a parameter is read from depends on its annotation:
a `Recording` is a folder, a `Calibration` a file, names stand behind commas.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from importlib import import_module
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.body import Mass, Sensors, Stature, chosen_body
from oarlock.cli.options import (
    Json,
    ModelName,
    OutFile,
    Replace,
    Settings,
    assignments,
    example,
    metavar_of,
    names,
)
from oarlock.cli.terminal import free_file, print_json, progress, say, steps, verb
from oarlock.cli.unit_options import assignment
from oarlock.storage.regular_file import read_text

if TYPE_CHECKING:
    from oarlock import Calibration

PACKAGE = Path(__file__).parents[1]
SMALLEST = {"jobs": 1}
"""Bounds of whole numbers, by name."""
SHORT = {"model": ("-m",), "out": ("-o",)}
REQUIRED: Any = ...


@dataclass(frozen=True)
class FunctionText:
    """Signature and docstring of a public function, read from its source: an import may take a second.

    Args:
        place: module and name, `oarlock.calibration.static.pose_mounts:calibrate_pose`.
        parameters: name -> annotation without `| None`, and default; that of an expression is None.
        doc: docstring.
    """

    place: str
    parameters: Mapping[str, tuple[str, Any]]
    doc: str

    @classmethod
    def of(cls, place: str) -> FunctionText:
        """Read the source of a function.

        Raises:
            LookupError: the module defines no such function.
        """
        module, _, name = place.partition(":")
        source = read_text(PACKAGE.joinpath(*module.split(".")[1:]).with_suffix(".py"))
        for node in ast.parse(source).body:
            if isinstance(node, ast.FunctionDef) and node.name == name:
                return cls(place, _parameters(node.args), ast.get_docstring(node) or "")
        raise LookupError(f"{module} defines no function {name}")

    def load(self) -> Callable[..., Any]:
        """The function itself."""
        module, _, name = self.place.partition(":")
        function: Callable[..., Any] = getattr(import_module(module), name)
        return function

    @property
    def summary(self) -> str:
        """First line of the docstring."""
        return self.doc.partition("\n")[0]

    def about(self, parameter: str) -> str:
        """The first sentence of a parameter's entry in Args, and what None means: it is the default."""
        entry = re.search(rf"^ {{4}}{parameter}: (.*(?:\n {{8,}}.*)*)", self.doc, re.M)
        text = re.sub(r"`+", "", " ".join(entry[1].split())) if entry else ""
        first, *others = re.split(r"(?<=[.;]) ", text)
        default = next((sentence for sentence in others if sentence.startswith("None")), "").rstrip(".;")
        default = re.sub(r"^None(:| is| takes| finds| uses)?", "; default:", default)
        return f"{first[:1].upper()}{first[1:].rstrip('.;')}{default}."


def _parameters(arguments: ast.arguments) -> dict[str, tuple[str, Any]]:
    placed = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(placed) - len(arguments.defaults)) + [
        *arguments.defaults,
        *arguments.kw_defaults,
    ]
    return {
        one.arg: (ast.unparse(one.annotation).removesuffix(" | None"), _default(default))
        for one, default in zip([*placed, *arguments.kwonlyargs], defaults, strict=True)
        if one.annotation is not None
    }


def _default(node: ast.expr | None) -> Any:
    """A literal's value; None for an expression: the function itself then has its default."""
    if node is None:
        return REQUIRED
    try:
        return ast.literal_eval(node)
    except ValueError:
        return None


@dataclass(frozen=True)
class Kind:
    """How a parameter of an annotation is typed.

    Attributes:
        type: for typer; None for what is no option.
        metavar: what stands for the value.
        read: from the typed value to the argument.
    """

    type: Any
    metavar: str | None = None
    read: Callable[[str, Any], Any] = lambda option, value: value


def _calibration(option: str, file: Path) -> Any:
    import oarlock

    return oarlock.load_calibration(file)


KINDS: Mapping[str, Kind] = {
    "Calibration": Kind(Path, "FILE", _calibration),
    **dict.fromkeys(
        ("Iterable[str]", "Sequence[str]", "str | Iterable[str]"),
        Kind(str, "NAMES", lambda option, text: names(text)),
    ),
    "Mapping[str, float] | ArrayLike": Kind(
        list[str], "JOINT=VALUE", lambda option, texts: assignments(texts, option) or None
    ),
    "Span": Kind(tuple[float, float], "START END"),
    "Span | Mapping[str, Span]": Kind(tuple[float, float], "START END"),
    "float": Kind(float),
    "int": Kind(int, "N"),
    "bool": Kind(bool),
    "Progress": Kind(None),
    "Model | AnyPath": Kind(str, "NAME|FILE"),
    "Recording | AnyPath": Kind(Path, "PATH"),
    "Calibration | AnyPath": Kind(Path, "FILE"),
    "Mapping[str, str] | AnyPath": Kind(
        list[str], "SENSOR=UNIT,...|FILE", lambda option, texts: assignment(texts)
    ),
    "AnyPath": Kind(Path, "FOLDER"),
    "str": Kind(str, "NAME"),
}


def option_of(function: FunctionText, name: str) -> tuple[str, Any, Any] | None:
    """Name, annotation and default of the option of a parameter; None if it is no option.

    Raises:
        LookupError: no `KINDS` has its annotation.
    """
    annotation, default = function.parameters[name]
    kind = KINDS[annotation]
    if kind.type is None:
        return None
    metavar = kind.metavar or metavar_of(name, kind.type)
    flag = flag_of(name)
    if kind.type is bool and default is not False:
        flag = f"{flag}/--no-{flag.removeprefix('--')}"
    option = typer.Option(
        flag,
        *SHORT.get(name, ()),
        metavar=metavar,
        help=function.about(name),
        min=SMALLEST.get(name),
    )
    return name, Annotated[kind.type | None if default is None else kind.type, option], default


def flag_of(name: str) -> str:
    """`--still-s` of `still_s`."""
    return f"--{name.replace('_', '-')}"


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


def options_of(
    function: FunctionText, *positional: str, without: Collection[str] = ()
) -> list[tuple[str, Any, Any]]:
    """Name, annotation and default of all parameters of a function, those of `positional` as arguments."""
    options = []
    for name, (annotation, default) in function.parameters.items():
        if name in positional:
            kind = KINDS[annotation]
            place = typer.Argument(metavar=kind.metavar, help=function.about(name))
            options.append((name, Annotated[kind.type, place], default))
        elif name not in without and (option := option_of(function, name)):
            options.append(option)
    return options


def arguments_of(function: FunctionText, typed: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of a function from what was typed; what was not typed has the function's default."""
    return {
        name: KINDS[function.parameters[name][0]].read(flag_of(name), value)
        for name, value in typed.items()
        if value is not None
    }


def calibration_verb(
    group: typer.Typer,
    name: str,
    place: str,
    show: Callable[[Calibration], None],
    *commands: str,
    cuts: bool = False,
) -> None:
    """Adds the verb of a function of a model and a recording that returns a calibration.

    Args:
        group: of verbs.
        name: of the verb.
        place: module and name of the function.
        show: prints the result.
        commands: examples.
        cuts: `--sensors` cuts the body, and `--stature-m` and `--mass-kg` set its lengths.
    """
    function = FunctionText.of(place)
    own = [name for name in function.parameters if name not in ("model", "recording")]
    own = [name for name in own if not (cuts and name == "sensors")]
    place_of_recording = typer.Argument(metavar="RECORDING", help="A recording folder.")
    options: list[tuple[str, Any, Any]] = [
        ("recording", Annotated[Path, place_of_recording], REQUIRED),
        ("model", ModelName, REQUIRED),
        ("out", OutFile, REQUIRED),
        ("settings", Settings, None),
        *(
            [("stature_m", Stature, None), ("mass_kg", Mass, None), ("sensors", Sensors, None)]
            if cuts
            else []
        ),
        *(option for name in own if (option := option_of(function, name))),
        ("force", Replace, False),
        ("json_output", Json, False),
    ]

    def run(recording: Path, model: str, out: Path, force: bool, json_output: bool, **typed: Any) -> None:
        import oarlock

        of_body = {name: typed.pop(name) for name in ("stature_m", "mass_kg", "sensors") if cuts}
        body = chosen_body(model, assignments(typed.pop("settings"), "--set"), **of_body)
        free_file(out, force)
        arguments = arguments_of(function, typed)
        shown: AbstractContextManager[Any] = progress("calibrating")
        if "progress" in own:
            arguments["progress"], shown = True, nullcontext()
        with shown:
            calibration = function.load()(body, oarlock.load_recording(recording), **arguments)
        calibration.save(out)
        if json_output:
            clocks = {name: vars(clock) for name, clock in calibration.clocks.items()}
            values = {"parameters": calibration.parameters, "clocks": clocks, "noted": calibration.noted}
            print_json({"calibration": out, **values})
            return
        say(f"Wrote {out}", style="bold")
        show(calibration)
        steps(track_next(recording, model, out, calibration, of_body))

    about = function.doc.partition("\n\nArgs:")[0]
    group.command(name, help=about, short_help=function.summary, epilog=example(*commands))(
        made_verb(run, options)
    )


def track_next(
    recording: Path, model: str, file: Path, calibration: Calibration, body: Mapping[str, Any] | None = None
) -> str:
    """The command that tracks with a calibration: of the same body, without streams that it left out."""
    from oarlock.pipeline import balls_of

    given = {name.replace("_", "-"): value for name, value in (body or {}).items() if value is not None}
    words = [f" --{name} {value}" for name, value in given.items()]
    words += [f" --ball {','.join(pair)}" for pair in balls_of(calibration)]
    if calibration.noted.get("left_out"):
        words.append(f" --streams {','.join(calibration.mounts)}")
    return f"oarlock track {recording} --model {model} --calibration {file}{''.join(words)} --out {recording}-track"
