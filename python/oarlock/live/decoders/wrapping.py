"""Unwraps counters and clocks of devices, one value after the other, for the decoders."""

from __future__ import annotations

REGISTERS = (2**8, 2**16, 2**24, 2**32)


class Wrapping:
    """A counter or clock that goes on at 0 after the last value of its register.

    A step is the difference that is nearest to zero modulo the register, so that a message that comes late does not
    add a turn. If the register is not known, the first step back that is shorter as a wrap shows which it is. A value
    beyond the largest register shows that nothing wraps.

    Args:
        registers: numbers of values, from the smallest; several if it is not known which.
    """

    def __init__(self, *registers: int) -> None:
        self._registers = registers
        self._last: int | None = None
        self._most = 0
        self._unwrapped = 0

    def unwrapped(self, value: int) -> int:
        """The value without wraps; the first is as it is."""
        self._most = max(self._most, value)
        self._registers = tuple(register for register in self._registers if register > self._most)
        if self._last is None:
            self._unwrapped = value
        else:
            self._unwrapped += self._step(value - self._last)
        self._last = value
        return self._unwrapped

    def _step(self, step: int) -> int:
        if not self._registers or (len(self._registers) > 1 and step >= 0):
            return step
        register = self._registers[0]
        nearest = (step + register // 2) % register - register // 2
        if len(self._registers) > 1 and nearest > 0:
            self._registers = (register,)
        return nearest if len(self._registers) == 1 else step
