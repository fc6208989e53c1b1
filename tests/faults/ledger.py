"""What clients were told, and what they saw: the run's own books, which the audit compares."""

import threading
from collections import Counter
from dataclasses import dataclass, field

TrackKey = tuple[str, str, str, float]


@dataclass
class Ledger:
    """Written by all clients' threads."""

    acknowledged: set[TrackKey] = field(default_factory=set)
    acts: list[tuple[str, str]] = field(default_factory=list)  # alert, message type; in order
    answers: Counter[tuple[str, int]] = field(default_factory=Counter)
    oddities: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    problems: Counter[str] = field(default_factory=Counter)
    took_s: dict[str, list[float]] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def answered(self, what: str, status: int, text: str) -> None:
        """Count an answer; one that says less than it should is a problem."""
        with self.lock:
            self.answers[what, status] += 1
            if status >= 500 and status not in (503, 507):
                self.problems[f"{what} was answered {status}: {text[:90]}"] += 1

    def refusals(self) -> int:
        """Answers of 5xx so far."""
        with self.lock:
            return sum(count for (_, status), count in self.answers.items() if status >= 500)

    def acknowledge(self, keys: set[TrackKey]) -> None:
        with self.lock:
            self.acknowledged |= keys

    def act(self, alert_id: str, type_: str) -> None:
        with self.lock:
            self.acts.append((alert_id, type_))

    def fault(self, name: str) -> None:
        with self.lock:
            self.faults[name] += 1

    def problem(self, text: str) -> None:
        with self.lock:
            self.problems[text] += 1

    def recovered(self, name: str, seconds: float) -> None:
        """Note how long it took until all was ready again after something."""
        with self.lock:
            self.took_s.setdefault(name, []).append(seconds)

    def recoveries(self) -> dict[str, str]:
        """The longest of each kind, in words."""
        with self.lock:
            return {name: f"{max(took):.1f}" for name, took in sorted(self.took_s.items())}
