"""What a user can use of package and oarlock-lab, by table of `checks/inventory.toml`; for `checks/inventory.py`."""

import ast
import inspect
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from checks.arrows import LAB, PACKAGE, python_files
from checks.engine_arrows import ENGINE, engine_files
from checks.project_files import text_of

CATALOGUES = {
    "shipped-models": ("oarlock.model.shipped_files:model_names",),
    "import-formats": ("oarlock.formats.importers:FORMATS",),
    "marker-files": ("oarlock.formats.marker_files:ENDINGS",),
    "stroke-exports": (
        "oarlock.rowing.exports.load:EXPORT_FORMATS",
        "oarlock.rowing.exports.load:FILE_KINDS",
    ),
    "activity-columns": ("oarlock.rowing.exports.activity:COLUMNS",),
    "transports": ("oarlock.live.transports:TRANSPORTS",),
    "wire-formats": ("oarlock.live.decoders:DECODERS",),
    "emulated-devices": ("oarlock_lab.emulators.kinds:KINDS",),
    "estimators": ("oarlock.evaluation.comparison.estimators:estimators",),
    "simulators": ("oarlock.rowing:SIMULATORS", "oarlock.rowing.simulation.simulators:PRESETS"),
    "simulated-effects": ("oarlock.rowing.field.effects:GROUPS",),
    "simulated-conditions": ("oarlock.rowing:CONDITIONS",),
    "target-classes": ("oarlock.rowing:TARGET_CLASSES",),
    "season-questions": ("oarlock.season:QUESTIONS",),
    "paper-parts": ("oarlock_lab.reproduce.reproduce:PARTS",),
    "rig-file": ("oarlock.live.rig:_TOP", "oarlock.live.rig:_OF_STREAM"),
    "study-file": tuple(
        f"oarlock.evaluation.study.study_file:{part}" for part in ("_TOP", "_TABLES", "_FAULT")
    ),
}
"""Collections of the package whose members have names that a user writes or reads: `module:attribute`."""
PUBLIC = (
    *(
        "oarlock",
        "oarlock.calibration",
        "oarlock.evaluation",
        "oarlock.live",
        "oarlock.markers",
        "oarlock.model",
    ),
    *("oarlock.movement", "oarlock.recording", "oarlock.report", "oarlock.rowing", "oarlock.season"),
    *("oarlock.simulation", "oarlock.studies", "oarlock.tracking"),
)
SCORES = (
    "oarlock.evaluation.scores",
    "oarlock.evaluation.marker_scores",
    "oarlock.evaluation.orientation_scores",
)
STROKE_METRICS = ("features.toml", "logger_features.toml")
MODEL_KEYS = {
    "file": ("model/spec.rs", "const KEYS"),
    "world": ("model/spec/world.rs", "const KEYS"),
    "links": ("model/links.rs", "const KEYS"),
    "parameters": ("model/spec.rs", "const PARAMETER_KEYS"),
    "process": ("model/spec/joint.rs", 'get("process").and_then'),
    "process of a kind": ("model/spec/joint.rs", "const PROCESS_KEYS"),
    "joint": ("model/spec/joint.rs", "const KEYS"),
    "joint translation": ("model/spec/joint.rs", "const TRANSLATION_KEYS"),
    "joint limits": ("model/spec/joint/range.rs", "const CONE_KEYS"),
    "frame": ("model/spec/frame.rs", "const KEYS"),
    "frame dh": ("model/spec/frame.rs", "const DH_KEYS"),
    "frame transform": ("model/spec/frame.rs", "const TRANSFORM_KEYS"),
    "sensor mount": ("sensor/mount.rs", "let keys"),
    "sensor contact": ("sensor/imu/contact.rs", 'get("contact")'),
    "closure": ("sensor/closure.rs", "const KEYS"),
    "base_acceleration": ("model/spec/world.rs", "const BASE_ACCELERATION_KEYS"),
}
"""Tables of a model file: the engine's source file, and what stands before the list of keys. Sensors are found."""
PAGES = {
    "report": ("report/page.py",),
    "movement report": ("movement/sections.py",),
    "rowing report": ("rowing/report/sections.py", "rowing/report/beside.py", "rowing/report/drawings.py"),
    "export page": (
        *("rowing/report/export_page.py", "rowing/report/export_piece.py"),
        *("rowing/report/export_force.py", "rowing/report/export_pace.py"),
    ),
    "crew page": ("rowing/report/crew_page.py",),
    "season page": ("season/page.py",),
    "comparison page": ("report/comparison.py",),
    "study page": ("report/study_page.py",),
    "page of faults": ("report/fault_page.py",),
    "page of markers": ("report/markers.py",),
    "page of a session": ("report/session_page.py",),
}
"""Pages and the modules that name their sections."""
EVERYWHERE = ("--quiet", "--verbose")
"""Options of every verb; they stand once, as those of `oarlock`."""
_SECTION_KEY = re.compile(r"[a-z][a-z0-9-]*")
_SECTION_TITLE = re.compile(r"[A-Z][^<>]{2,}")


def surface() -> dict[str, set[str]]:
    """Names by table; a part has the name of its owner before it: `track --model`.

    Raises:
        ImportError: the package is not built, or is imported from another checkout.
        AttributeError, LookupError: a place that this module names is not there any more.
    """
    sys.path[:0] = [str(PACKAGE.parent), str(LAB.parent)]
    oarlock = import_module("oarlock")
    if not Path(str(oarlock.__file__)).is_relative_to(PACKAGE):
        raise ImportError(f"oarlock comes from {oarlock.__file__}, not from this checkout")
    commands = dict(_commands())
    return {
        "verbs": set(commands),
        "options": {f"{path} {option}" for path, options in commands.items() for option in options}
        | {f"oarlock {option}" for option in EVERYWHERE},
        **_settings(oarlock.Config),
        "model": set(_model_keys()),
        **{
            table: {name for place in places for name in _names(place)}
            for table, places in CATALOGUES.items()
        },
        "written-files": {
            f"{kind} {file}"
            for kind, files in import_module("oarlock.formats.export.export").files_of().items()
            for file in files
        },
        "live-outputs": {field.name for field in fields(import_module("oarlock.live.outputs.table").Outputs)},
        "stroke-metrics": set(_stroke_metrics()),
        "scores": {f"{name} {part}" for name, kind in _score_classes() for part in attributes(kind)},
        "sections": set(_sections()),
        "python": {name for name, _ in _public_things()},
        "members": {f"{name} {part}" for name, thing in _public_things() for part in attributes(thing)},
    }


@cache
def texts() -> str:
    """All sources of package and engine, with texts that are written over several lines in one."""
    pages = [path for path in PACKAGE.rglob("*") if path.suffix in {".j2", ".js", ".html"}]
    python = "\n".join(
        re.sub(r'"\s*\n\s*[rf]*"', "", text_of(path)) for path in [*python_files(), *python_files(LAB)]
    )
    rust = "\n".join(re.sub(r"\\\n\s*", "", text_of(path)) for path in engine_files())
    return "\n".join([python, rust, *map(text_of, pages)])


def _commands() -> Iterator[tuple[str, list[str]]]:
    """Path and options of each command; the program itself is called `oarlock`."""
    cli, get_group = import_module("oarlock.cli"), import_module("typer.main").get_group
    yield "oarlock", _options(get_group(cli.app))
    for verb in cli.VERBS:
        yield from _below(verb, cli.load_verb(verb))


def _below(path: str, command: Any) -> Iterator[tuple[str, list[str]]]:
    yield path, _options(command)
    for name, inner in getattr(command, "commands", {}).items():
        yield from _below(f"{path} {name}", inner)


def _options(command: Any) -> list[str]:
    options = [param for param in command.params if param.param_type_name == "option"]
    names = [name for option in options for name in (*option.opts, *option.secondary_opts)]
    return [name for name in names if name.startswith("--") and name not in EVERYWHERE]


def _settings(config: Any) -> dict[str, set[str]]:
    """Settings of the filter, and the values of those that are a choice, as the engine's refusal lists them."""
    names = set(config().to_dict())
    values = set()
    for name in names:
        try:
            config(**{name: "?"})
        except (TypeError, ValueError) as error:
            values |= {f"{name} {value}" for value in re.findall(r"`(\w+)`", str(error))}
    return {"settings": names, "values": values}


def _model_keys() -> Iterator[str]:
    lists = {table: (ENGINE / file, before) for table, (file, before) in MODEL_KEYS.items()}
    for path in sorted((ENGINE / "sensor").glob("*.rs")):
        if kind := re.search(r"const NAME: &'static str = \"(\w+)\"", text_of(path)):
            lists[f"sensor {kind[1]}"] = (path, "const KEYS")
    for table, (path, before) in lists.items():
        yield from (f"{table} {key}" for key in _key_list(path, before))
    edit, mirror = import_module("oarlock.model.edit"), import_module("oarlock.model.mirror")
    yield from (f"extended {key}" for key in edit._PLACE)
    yield from (f"mirror {key}" for key in mirror._KEYS)


def _key_list(path: Path, before: str) -> list[str]:
    """The first list of texts after these words."""
    text = text_of(path) if path.is_file() else ""
    keys = re.search(re.escape(before) + r'.*?\[((?:\s*"\w+",?)+)\s*\]', text, re.DOTALL)
    if keys is None:
        raise LookupError(f"{path} has no list of keys after '{before}'")
    return re.findall(r"\w+", keys[1])


def _names(place: str) -> Iterable[str]:
    """Names in a collection of the package, or in that which a function returns."""
    module, _, attribute = place.partition(":")
    things = getattr(import_module(module), attribute)
    things = things() if callable(things) else things
    return (thing if isinstance(thing, str) else thing.name for thing in things)


def _stroke_metrics() -> Iterator[str]:
    for file in STROKE_METRICS:
        metrics: Mapping[str, Any] = tomllib.loads(text_of(PACKAGE / "rowing/analysis" / file))
        for name, metric in metrics.items():
            sides = metric.get("sides", "no")
            yield from [name] * (sides != "only") + [f"{name} of each side"] * (sides != "no")


def _score_classes() -> Iterator[tuple[str, type]]:
    for module in map(import_module, SCORES):
        for name, kind in inspect.getmembers(module, inspect.isclass):
            if kind.__module__ == module.__name__ and not name.startswith("_"):
                yield name, kind


def _public_things() -> Iterator[tuple[str, Any]]:
    for module in map(import_module, PUBLIC):
        things = ((f"{module.__name__}.{name}", getattr(module, name)) for name in module.__all__)
        yield from ((name, thing) for name, thing in things if not inspect.ismodule(thing))


def attributes(thing: Any) -> set[str]:
    """Fields, properties and methods of a class, or parameters of a function, that have public names."""
    if inspect.isclass(thing):
        own = [kind for kind in thing.__mro__ if kind.__module__.partition(".")[0] == "oarlock"]
        names = {name for kind in own for name in vars(kind)}
        names |= {field.name for field in fields(thing)} if is_dataclass(thing) else set()
    else:
        names = set(inspect.signature(thing).parameters) if inspect.isfunction(thing) else set()
    return {name for name in names if not name.startswith("_")}


def _sections() -> Iterator[str]:
    """Titles of sections: what stands behind a section's key, in a call of `Section` or a tuple of three."""
    page_of = {file: page for page, files in PAGES.items() for file in files}
    for path in python_files():
        file = path.relative_to(PACKAGE).as_posix()
        if path.suffix == ".py" and (file in page_of or "report" in file or "page" in file):
            for title in _titles(ast.parse(text_of(path))):
                yield f"{page_of.get(file, file)} {title}"


def _titles(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Section":
            parts = node.args
        elif isinstance(node, ast.Tuple):
            parts = node.elts
        else:
            continue
        words = [
            part.value for part in parts[:2] if isinstance(part, ast.Constant) and isinstance(part.value, str)
        ]
        if (
            len(parts) > 2
            and len(words) == 2
            and _SECTION_KEY.fullmatch(words[0])
            and _SECTION_TITLE.fullmatch(words[1])
        ):
            yield words[1]
