"""A clock that a test may put forward: what the service takes for now."""

import sys
import time as real_time
from datetime import datetime as real_datetime
from datetime import timedelta
from typing import Any


class ShiftedClock:
    """Stands in for `datetime` and `time` in the service's modules while it is entered."""

    def __init__(self) -> None:
        self.ahead = timedelta()
        self._kept: list[tuple[Any, str, Any]] = []

    def now_s(self) -> float:
        return real_time.time() + self.ahead.total_seconds()

    def __enter__(self) -> "ShiftedClock":
        stand_ins = ((real_datetime, _Datetime(self)), (real_time, _Time(self)))
        for name, module in list(sys.modules.items()):
            if name.split(".")[0] != "service":
                continue
            for attribute, value in list(vars(module).items()):
                for real, stand_in in stand_ins:
                    if value is real:
                        self._kept.append((module, attribute, value))
                        setattr(module, attribute, stand_in)
        return self

    def __exit__(self, *_: object) -> None:
        for module, attribute, value in self._kept:
            setattr(module, attribute, value)


class _Datetime:
    def __init__(self, clock: ShiftedClock) -> None:
        self._clock = clock

    def now(self, tz: Any = None) -> real_datetime:
        return real_datetime.now(tz) + self._clock.ahead

    def __instancecheck__(self, value: object) -> bool:
        return isinstance(value, real_datetime)

    def __call__(self, *args: Any, **kwargs: Any) -> real_datetime:
        return real_datetime(*args, **kwargs)

    def __getattr__(self, name: str) -> Any:
        return getattr(real_datetime, name)


class _Time:
    def __init__(self, clock: ShiftedClock) -> None:
        self._clock = clock

    def time(self) -> float:
        return self._clock.now_s()

    def __getattr__(self, name: str) -> Any:
        return getattr(real_time, name)
