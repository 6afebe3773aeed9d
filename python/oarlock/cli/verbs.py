"""Makes verbs of functions: arguments, options and their help come from signature and docstring, JSON from the result.

Parameters before `*` are arguments, the others options: `still_s` is `--still-s`, `with_` is `--with`. What a parameter
is read from depends on its annotation (`KINDS`): a `Recording` is a folder, `tuple[str, ...]` names behind commas. One
whose annotation is in `GROUPS` has several options. What the function returns is printed, by `show` or as JSON.
"""

from __future__ import annotations

import ast
import datetime
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from oarlock.cli.show import UNITS, show_document
from oarlock.cli.terminal import (
    EXIT_DATA,
    QUIET,
    UsageError,
    check_folder,
    free_file,
    print_json,
    set_verbosity,
    verb,
    write_error,
)
from oarlock.storage.regular_file import read_text

PACKAGE = Path(__file__).parents[1]
NewFile = Path
"""A file to write; `--force` replaces what is there."""
NewFolder = Path
"""A folder to write; `--force` replaces what is there, other files stay."""
ModelName = str
"""Name of a shipped model, or a model file."""
Pseudonym = str
"""Of an athlete of a season."""
REQUIRED: Any = ...
Function = TypeVar("Function", bound=Callable[..., Any])


class Incomplete(Exception):
    """Raised by a verb that could not do everything: its result is printed, and the exit status is 1.

    Args:
        result: what it would have returned.
        message: an error for stderr.
    """

    def __init__(self, result: Any, message: str = "") -> None:
        super().__init__(message)
        self.result, self.message = result, message


# --- kinds of parameters ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """How a parameter of an annotation is typed.

    Attributes:
        type: for typer; None for what is no option.
        metavar: what stands for the value.
        read: from the option's name and the typed value to the argument.
    """

    type: Any
    metavar: str = ""
    read: Callable[[str, Any], Any] = lambda option, value: value


def names(text: str) -> tuple[str, ...]:
    """`"gyro_bias,surge"` as `("gyro_bias", "surge")`; an empty text or `none` as `()`."""
    return tuple(name for part in text.split(",") if (name := part.strip()) and name != "none")


def assignments(
    texts: Sequence[str] | None, flag: str, sample: str = "l_ua_r=0.31", unit: str = "SI units: m, rad"
) -> dict[str, float]:
    """`["l_ua_r=0.31"]` as `{"l_ua_r": 0.31}`; `sample` and `unit` are for the error messages.

    Raises:
        UsageError: a text is not NAME=NUMBER, or a name comes twice.
    """
    numbers: dict[str, float] = {}
    for name, value in text_assignments(texts, flag, sample).items():
        try:
            numbers[name] = float(value)
        except ValueError:
            raise UsageError(f"{flag} {name}={value}: '{value}' is not a number ({unit})") from None
    return numbers


def text_assignments(
    texts: Sequence[str] | None, flag: str, sample: str, form: str = "NAME=VALUE"
) -> dict[str, str]:
    """`["back=65577B49"]` as `{"back": "65577B49"}`: a name may have `=`; `sample` and `form` are for errors.

    Raises:
        UsageError: a text is not of this form, or a name comes twice.
    """
    values: dict[str, str] = {}
    for text in texts or ():
        name, equals, value = (part.strip() for part in text.rpartition("="))
        if not (name and equals and value):
            raise UsageError(f"{flag} {text}: expected {form}, for example {flag} {sample}")
        if name in values:
            raise UsageError(f"{flag}: {name} is given twice")
        values[name] = value
    return values


def _imported(place: str) -> Callable[..., Any]:
    """The function at `module:name`."""
    module, _, name = place.partition(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function


def _loaded(place: str) -> Callable[[str, Any], Any]:
    """A reader that imports the package only when it reads."""
    return lambda option, value: _imported(place)(value)


def _day(option: str, text: str) -> datetime.date:
    """A day.

    Raises:
        UsageError: the text is none.
    """
    try:
        return datetime.date.fromisoformat(text)
    except ValueError:
        raise UsageError(f"{option} {text}: expected a day such as 2026-05-01") from None


_NAMES = Kind(str, "NAMES", lambda option, text: names(text))
_FILE = Kind(Path, "FILE")
KINDS: dict[str, Kind] = {
    "bool": Kind(bool),
    "float": Kind(float),
    "int": Kind(int, "N"),
    "str": Kind(str, "NAME"),
    "ModelName": Kind(str, "NAME|FILE"),
    "Pseudonym": Kind(str, "PSEUDONYM"),
    "datetime.date": Kind(str, "DATE", _day),
    "Path": _FILE,
    "NewFile": _FILE,
    "NewFolder": Kind(Path, "FOLDER"),
    "AnyPath": Kind(Path, "FOLDER"),
    "Recording": Kind(Path, "RECORDING", _loaded("oarlock:load_recording")),
    "Recording | AnyPath": Kind(Path, "PATH"),
    "Calibration": Kind(Path, "FILE", _loaded("oarlock:load_calibration")),
    "Calibration | AnyPath": _FILE,
    "Model": Kind(str, "NAME|FILE", _loaded("oarlock:load_model")),
    "Model | AnyPath": Kind(str, "NAME|FILE"),
    "Season": Kind(str, "SEASON", _loaded("oarlock.season:open_season")),
    **dict.fromkeys(("tuple[str, ...]", "Iterable[str]", "Sequence[str]", "str | Iterable[str]"), _NAMES),
    "list[str]": Kind(list[str], "NAME"),
    "list[Path]": Kind(list[Path], "FILE"),
    "dict[str, float]": Kind(list[str], "NAME=VALUE", lambda option, texts: assignments(texts, option)),
    "Mapping[str, float] | ArrayLike": Kind(
        list[str], "JOINT=VALUE", lambda option, texts: assignments(texts, option) or None
    ),
    "Mapping[str, str] | AnyPath": Kind(
        list[str], "SENSOR=UNIT,...|FILE", _loaded("oarlock.cli.calibrate_units:assignment")
    ),
    "Span": Kind(tuple[float, float], "START END"),
    "Span | Mapping[str, Span]": Kind(tuple[float, float], "START END"),
    "Progress": Kind(None),
}
"""By annotation, without `| None`."""
GROUPS = {
    "Body": "oarlock.cli.body:body_of",
    "SizedBody": "oarlock.cli.body:body_of",
    "MarkerSource": "oarlock.cli.markers:marker_source",
    "Session": "oarlock.cli.session_options:session_of",
    "ScanRequest": "oarlock.cli.live_scan:scan_request",
    "LivePage": "oarlock.cli.live:LivePage",
    "Selection": "oarlock.cli.season:selection_of",
}
"""By annotation: a function whose parameters are options and whose result is the argument."""
LEFT_OUT = {"SizedBody": ("sensors",)}
"""By annotation: parameters of the group's function that are no options."""
SMALLEST = {"jobs": 1}
"""Bounds of whole numbers, by name."""
SHORT = {"model": ("-m",), "out": ("-o",), "attachments": ("-a",), "format": ("-f",)}


def kind_of(annotation: str) -> Kind:
    """How a parameter is typed.

    Raises:
        LookupError: no kind has the annotation.
    """
    if annotation.startswith("Literal["):
        choices = ast.literal_eval(annotation.removeprefix("Literal"))

        def chosen(option: str, text: str) -> str:
            if text not in choices:
                raise UsageError(f"{option} {text}: choose one of {', '.join(choices)}")
            return text

        return Kind(str, "|".join(choices), chosen)
    return KINDS[annotation]


def unit_placeholder(name: str) -> str:
    """`RAD/S` of `gyro_bias_rad_s`, `X` of a name without a unit."""
    unit = next((end for end in UNITS if f"_{name}".endswith(f"_{end}")), "x")
    return unit.replace("_", "/").upper()


# --- options of a function ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Option:
    """An argument or an option of a verb.

    Attributes:
        name: of the parameter.
        annotation: without `| None`.
        default: `REQUIRED` without one.
        about: help.
        is_argument: no option.
        metavar: in place of that of the kind.
        bounds: smallest and largest number.
        opposite: option that switches a flag off; default: `no-NAME`.
    """

    name: str
    annotation: str
    default: Any = None
    about: str = ""
    is_argument: bool = False
    metavar: str = ""
    bounds: tuple[float | None, float | None] = (None, None)
    opposite: str = ""

    @property
    def flag(self) -> str:
        """`--still-s` of `still_s`."""
        return f"--{self.name.strip('_').replace('_', '-')}"

    def read(self, value: Any) -> Any:
        """The argument from what was typed."""
        return kind_of(self.annotation).read(self.flag, value)

    def parameter(self) -> Parameter:
        """For typer."""
        kind = kind_of(self.annotation)
        metavar = (
            self.metavar or kind.metavar or (unit_placeholder(self.name) if kind.type is float else None)
        )
        low, high = self.bounds
        low = SMALLEST.get(self.name) if low is None else low
        place: Any
        if self.is_argument:
            place = typer.Argument(metavar=metavar, help=self.about, min=low, max=high)
        else:
            flag = self.flag
            if kind.type is bool and self.default is not False:
                flag = f"{flag}/--{self.opposite or flag.replace('--', 'no-')}"
            place = typer.Option(
                flag, *SHORT.get(self.name, ()), metavar=metavar, help=self.about, min=low, max=high
            )
        typed = kind.type | None if self.default is None else kind.type
        default = Parameter.empty if self.default is REQUIRED else self.default
        if isinstance(default, tuple) and kind.type is str:
            typed, default = str | None, ",".join(default) or None
        return Parameter(
            self.name, Parameter.KEYWORD_ONLY, annotation=Annotated[typed, place], default=default
        )


FORCE = Option("force", "bool", False, "Replace what is there; other files stay.")
JSON = Parameter(
    "json_output",
    Parameter.KEYWORD_ONLY,
    annotation=Annotated[bool, typer.Option("--json", help="Print only one JSON document, on stdout.")],
    default=False,
)


@dataclass(frozen=True)
class FunctionText:
    """Parameters and docstring of a function.

    Attributes:
        options: its parameters.
        doc: docstring.
        load: gives the function.
    """

    options: tuple[Option, ...]
    doc: str
    load: Callable[[], Callable[..., Any]]

    @classmethod
    def of(cls, function: Callable[..., Any]) -> FunctionText:
        """Of a function of the command line: the whole entry of a parameter is its help."""
        doc, options = function.__doc__ or "", []
        for name, parameter in signature(function).parameters.items():
            annotation = str(parameter.annotation).removesuffix(" | None")
            default = REQUIRED if parameter.default is Parameter.empty else parameter.default
            is_argument = parameter.kind is not Parameter.KEYWORD_ONLY
            options.append(Option(name, annotation, default, _entry(doc, name), is_argument))
        return cls(tuple(options), doc, lambda: function)

    @classmethod
    def of_group(cls, annotation: str) -> FunctionText:
        """Of a group of options."""
        text = cls.of(_imported(GROUPS[annotation]))
        return replace(text, options=text.only(without=LEFT_OUT.get(annotation, ())))

    @classmethod
    def at(cls, place: str) -> FunctionText:
        """Of a public function, read from its source, since an import may take a second: its help is short.

        Args:
            place: module and name, `oarlock.calibration.static.pose_mounts:calibrate_pose`.

        Raises:
            LookupError: the module defines no such function.
        """
        module, _, name = place.partition(":")
        source = read_text(PACKAGE.joinpath(*module.split(".")[1:]).with_suffix(".py"))
        for node in ast.parse(source).body:
            if isinstance(node, ast.FunctionDef) and node.name == name:
                doc = ast.get_docstring(node) or ""
                options = [replace(one, about=_short(_entry(doc, one.name))) for one in _options(node.args)]
                return cls(tuple(options), doc, lambda: _imported(place))
        raise LookupError(f"{module} defines no function {name}")

    @property
    def summary(self) -> str:
        """First line of the docstring."""
        return self.doc.partition("\n")[0]

    @property
    def about(self) -> str:
        """The docstring before Args, Returns and Raises, without indentation."""
        text = re.split(r"\n\s*(?:Args|Returns|Raises|Yields):\n", self.doc)[0]
        return re.sub(r"\n[ ]+", "\n", text).strip()

    def only(self, *names: str, without: Sequence[str] = ()) -> tuple[Option, ...]:
        """Options of these names, in their order; without names all but `without`."""
        by_name = {option.name: option for option in self.options}
        return tuple(by_name[name] for name in names or by_name if name not in without)


def _options(arguments: ast.arguments) -> list[Option]:
    placed = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(placed) - len(arguments.defaults)) + list(arguments.defaults)
    every = [*zip(placed, defaults, strict=True)]
    every += [*zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)]
    return [
        Option(one.arg, ast.unparse(one.annotation).removesuffix(" | None"), _default(default))
        for one, default in every
        if one.annotation is not None
    ]


def _default(node: ast.expr | None) -> Any:
    """A literal's value; None for an expression: the function itself then has its default."""
    if node is None:
        return REQUIRED
    try:
        return ast.literal_eval(node)
    except ValueError:
        return None


def _entry(doc: str, parameter: str) -> str:
    """What Args says of a parameter, as one line, with a capital and a full stop."""
    entry = re.search(rf"^( +){parameter}: (.*(?:\n\1 {{4,}}.*)*)", doc, re.M)
    text = " ".join(entry[2].split()) if entry else ""
    return f"{text[:1].upper()}{text[1:].rstrip('.;')}." if text else ""


def _short(entry: str) -> str:
    """The first sentence of an entry, and what None means: it is the default."""
    first, *others = re.split(r"(?<=[.;]) ", entry.replace("`", ""))
    default = next((sentence for sentence in others if sentence.startswith("None")), "").rstrip(".;")
    default = re.sub(r"^None(:| is| takes| finds| uses)?", "; default:", default)
    return f"{first.rstrip('.;')}{default}." if first else ""


# --- verbs --------------------------------------------------------------------------------------------


def example(*commands: str) -> str:
    """End of a help text: example commands."""
    return "\b\nExamples:\n" + "\n".join(f"  {command}" for command in commands)


def command(
    group: typer.Typer,
    *examples: str,
    name: str = "",
    show: Callable[[Any], None] = show_document,
    continues: bool = False,
    epilog: str = "",
    metavars: Mapping[str, str] | None = None,
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    defaults: Mapping[str, Any] | None = None,
    opposites: Mapping[str, str] | None = None,
) -> Callable[[Function], Function]:
    """Decorator: the function becomes a verb of a group.

    Args:
        group: of verbs.
        examples: commands.
        name: of the verb; default: that of the function.
        show: prints the result for people.
        continues: what is finished is kept when the verb is stopped.
        epilog: more text behind the examples.
        metavars: placeholder of a value, by parameter.
        bounds: smallest and largest number, by parameter.
        defaults: values in place of those of the function or of a group of options.
        opposites: option that switches a flag off, by parameter.
    """
    changes = {"metavar": metavars, "bounds": bounds, "default": defaults, "opposite": opposites}

    def add(function: Function) -> Function:
        text = FunctionText.of(function)
        verb_name = name or function.__name__.strip("_").replace("_", "-")
        add_verb(
            group,
            verb_name,
            text,
            function,
            show,
            *examples,
            continues=continues,
            epilog=epilog,
            changes={name: values for name, values in changes.items() if values},
        )
        return function

    return add


def add_verb(
    group: typer.Typer,
    name: str,
    text: FunctionText,
    function: Callable[..., Any],
    show: Callable[[Any], None],
    *examples: str,
    continues: bool = False,
    epilog: str = "",
    changes: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Adds a verb to a group: `command` with options that are not the function's own.

    Args:
        group: of verbs.
        name: of the verb.
        text: options and help.
        function: gets the options as keywords.
        show: prints the result for people.
        examples: commands.
        continues: what is finished is kept when the verb is stopped.
        epilog: more text behind the examples.
        changes: attribute of `Option` -> name of the option -> value.
    """
    wants = set(signature(function).parameters)
    own = [option for option in text.options if option.name not in ("force", "json_output")]
    groups = {
        option.name: FunctionText.of_group(option.annotation) for option in own if option.annotation in GROUPS
    }
    spread: list[Option] = []
    for option in own:
        first, *others = groups[option.name].options if option.name in groups else (option,)
        spread += [replace(first, is_argument=option.is_argument), *others]
    spread = [
        replace(option, **{key: of[option.name] for key, of in (changes or {}).items() if option.name in of})
        for option in spread
        if kind_of(option.annotation).type is not None
    ]
    by_name = {option.name: option for option in spread}
    writes = [option for option in spread if option.annotation in ("NewFile", "NewFolder")]

    def run(json_output: bool, force: bool = False, **typed: Any) -> None:
        for option in writes:
            if typed[option.name] is not None:
                (free_file if option.annotation == "NewFile" else check_folder)(typed[option.name], force)
        if json_output:
            set_verbosity(QUIET)
        arguments = {key: by_name[key].read(value) for key, value in typed.items() if value is not None}
        for name, group_text in groups.items():
            of_group = [option.name for option in group_text.options if option.name in arguments]
            arguments[name] = group_text.load()(**{key: arguments.pop(key) for key in of_group})
        arguments |= {"force": force} if "force" in wants else {}
        arguments |= {"json_output": json_output} if "json_output" in wants else {}
        failure: Incomplete | None = None
        try:
            result = function(**arguments)
        except Incomplete as incomplete:
            result, failure = incomplete.result, incomplete
        if json_output:
            print_json(result)
        elif result is not None:
            show(result)
        if failure is not None:
            if failure.message:
                write_error(failure.message)
            raise typer.Exit(EXIT_DATA)

    parameters = [option.parameter() for option in spread]
    parameters += [FORCE.parameter()] if writes or "force" in wants else []
    run.__signature__ = Signature([*parameters, JSON])  # type: ignore[attr-defined]
    group.command(
        name,
        help=text.about,
        short_help=text.summary,
        epilog="\n\n".join(part for part in (example(*examples) if examples else "", epilog) if part),
    )(verb(run, continues))
