"""`FaultSweep`: faults with varying strength, and filter settings that are compared under them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from oarlock.evaluation.study.keys import Value
from oarlock.storage.errors import DataError

NO_FAULT = "no fault"
USUAL_SETTING = "default"


@dataclass(frozen=True)
class FaultSweep:
    """One fault, from weak to strong.

    Args:
        name: name of the fault for readers.
        key: key of the study that is varied.
        strengths: values of the key, the weakest first.
        unit: unit of the strengths for labels: `deg`, `s`, `m`, `share`, or any text.
        of: streams that the strengths apply to; empty applies the key's default meaning of a number.
        usual: the strength at which faults are compared, typical of an ordinary recording; None is the middle one.
        meanwhile: other keys that are set together with the fault.
        labels: labels of the strengths, if a number with its unit is not suitable.
        says: a clause with `{}` instead of the strength, such as "mounts rotated by {}"; empty uses the name.
    """

    name: str
    key: str
    strengths: tuple[Value, ...]
    unit: str = ""
    of: tuple[str, ...] = ()
    usual: Value = None
    meanwhile: Mapping[str, Value] = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    says: str = ""

    def __post_init__(self) -> None:
        if not self.strengths:
            raise DataError(f'fault "{self.name}": strengths is empty; give one value or more')
        if self.labels and len(self.labels) != len(self.strengths):
            raise DataError(
                f'fault "{self.name}": {len(self.labels)} labels for {len(self.strengths)} strengths; '
                "give as many, or none"
            )
        if self.usual is not None and self.usual not in self.strengths:
            raise DataError(
                f'fault "{self.name}": usual = {self.usual!r} is not one of its strengths {list(self.strengths)}'
            )
        if self.says and self.says.count("{}") != 1:
            raise DataError(f'fault "{self.name}": says = {self.says!r}; expected one {{}} for the strength')

    @property
    def usual_index(self) -> int:
        """Index of the typical strength."""
        if self.usual is None:
            return (len(self.strengths) - 1) // 2
        return self.strengths.index(self.usual)

    @property
    def ordered(self) -> bool:
        """Whether strengths are numbers, so that they can be ordered."""
        return all(isinstance(value, int | float) for value in self.strengths)

    def values(self, index: int) -> dict[str, Value]:
        """The keys of a study for one strength."""
        strength = self.strengths[index]
        told: Value = dict.fromkeys(self.of, strength) if self.of else strength
        return {**self.meanwhile, self.key: told}

    def label(self, index: int) -> str:
        """A strength with its unit: `5 deg`, `20 ms`, `30 %`."""
        return self.labels[index] if self.labels else amount(self.strengths[index], self.unit)

    def sentence(self, index: int) -> str:
        """The fault at one strength in words."""
        text = self.label(index)
        return self.says.replace("{}", text) if self.says else f"{self.name}, {text}"


def amount(value: Value, unit: str) -> str:
    """A number with its unit: small times and lengths in ms and mm, shares in per cent."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return str(value)
    if unit in ("s", "m") and 0.0 < abs(value) < 0.1:
        return f"{1e3 * value:g} m{unit}"
    if unit == "share":
        return f"{100.0 * value:g} %"
    return f"{value:g} {unit}".strip()


def fault_scenarios(
    faults: Sequence[FaultSweep], settings: Mapping[str, Mapping[str, Value]]
) -> Iterator[tuple[str, dict[str, Value], dict[str, Value]]]:
    """Names, values and columns of all scenarios: for each setting no fault, and every fault at every strength."""
    for setting, own in (settings or {USUAL_SETTING: {}}).items():
        for name, label, told, column in _doses(faults):
            text = f"{name}, {label}" if label else name
            swept = {"fault": name, "strength": column, "label": label, "setting": setting}
            yield (f"{setting}: {text}", {**own, **told}, swept)


def _doses(faults: Sequence[FaultSweep]) -> Iterator[tuple[str, str, dict[str, Value], Value]]:
    yield NO_FAULT, "", {}, None
    for fault in faults:
        for index, strength in enumerate(fault.strengths):
            yield fault.name, fault.label(index), fault.values(index), strength
