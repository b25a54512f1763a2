"""Results: for people, as JSON, and the list of mistakes that were judged equivalent."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from .draw import Slot
from .mistakes import KINDS
from .suite import Verdict

# Verdicts of mistakes that count as missed.
MISSED = ("survives", "unreached", "open")
MEANINGS = {
    "survives": "every test passes with it",
    "unreached": "no test runs the function that holds it",
    "open": "not caught by the test that caught it before; no other one was run",
    "equivalent": "judged to change nothing, and not caught",
    "absent": "the function or the line does not exist in this revision",
    "does not compile": "refused by the compiler in this revision",
}


def read_equivalents(path: Path) -> dict[str, str]:
    """Reads the judged mistakes with their reasons: `identity -- reason` on each line."""
    if not path.exists():
        return {}
    equivalents = {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        identity, separator, reason = line.rpartition(" -- ")
        if not separator or not reason.strip():
            raise SystemExit(f"{path}:{number}: a mistake needs its reason behind ` -- `")
        equivalents[identity.strip()] = reason.strip()
    return equivalents


class Results:
    """The verdicts so far."""

    def __init__(self, slots: list[Slot], equivalents: dict[str, str], about: dict) -> None:
        self.slots = [slot for slot in slots if slot.mistake]
        self.equivalents = equivalents
        self.about = about
        self.verdicts: dict[int, Verdict] = {}

    def word(self, slot: Slot) -> str:
        """The verdict of a mistake in a word; empty while there is none."""
        if slot.obstacle:
            return slot.obstacle
        if slot.number not in self.verdicts:
            return ""
        word = self.verdicts[slot.number].verdict
        listed = slot.mistake.identity in self.equivalents
        return "equivalent" if listed and word in ("survives", "unreached") else word

    def line(self, slot: Slot) -> str:
        """A mistake and its verdict in a line."""
        word = self.word(slot)
        verdict = self.verdicts.get(slot.number)
        if word == "caught":
            word = f"caught by {verdict.test.label} ({verdict.how}) after {verdict.seconds:.1f} s"
        elif verdict and word != "open":
            word += f" ({verdict.reaching} tests reach it) after {verdict.seconds:.1f} s"
        mistake = slot.mistake
        where = f"{mistake.file}:{mistake.line}"
        return f"{slot.number:3}  {slot.package:9}  {slot.kind:10}  {where}  {word}".rstrip()

    def table(self) -> str:
        """All mistakes, each with its lines as they are and as they are spoilt."""
        rows = (
            f"{self.line(slot)}\n       - {slot.mistake.right}\n       + {slot.mistake.wrong}"
            for slot in self.slots
        )
        return "\n".join(rows)

    def share(self) -> tuple[int, int]:
        """The number of mistakes caught, and of those that count."""
        words = Counter(self.word(slot) for slot in self.slots)
        return words["caught"], words["caught"] + sum(words[word] for word in MISSED)

    def summary(self) -> str:
        """The shares caught by package and kind, and what was not caught."""
        lines = []
        for title, key in (("package", lambda slot: slot.package), ("kind", lambda slot: slot.kind)):
            lines += ["", f"{title:12}  caught  of", *self._shares(key)]
        for word, meaning in MEANINGS.items():
            slots = [slot for slot in self.slots if self.word(slot) == word]
            if slots:
                lines += ["", f"{word}: {meaning}"]
            for slot in slots:
                reason = self.equivalents.get(slot.mistake.identity)
                again = f" -- {reason}" if word == "equivalent" else ""
                lines.append(f"{slot.number:3}  {slot.mistake.identity}{again}")
        for slot in self.slots:
            if self.word(slot) == "caught" and slot.mistake.identity in self.equivalents:
                lines += ["", f"{slot.number} is listed as equivalent, and caught"]
        caught, counted = self.share()
        share = f", {caught / counted:.3f}" if counted else ""
        return "\n".join([*lines, "", f"caught: {caught} of {counted}{share}"])

    def _shares(self, key: Callable[[Slot], str]) -> list[str]:
        counted, caught = Counter(), Counter()
        for slot in self.slots:
            word = self.word(slot)
            counted[key(slot)] += word == "caught" or word in MISSED
            caught[key(slot)] += word == "caught"
        order = sorted(counted, key=lambda name: KINDS.index(name) if name in KINDS else -1)
        return [
            f"{name:12}  {caught[name]:6}  {counted[name]:2}  {caught[name] / counted[name]:.2f}"
            for name in order
            if counted[name]
        ]

    def write(self, path: Path) -> None:
        """Writes all mistakes and their verdicts as JSON; `--replay` reads it."""
        entries = []
        for slot in self.slots:
            entry = asdict(slot.mistake)
            for key in ("start", "end", "new", "scope"):
                del entry[key]
            entry = {"number": slot.number, **entry, "verdict": self.word(slot), "caught_by": None}
            verdict = self.verdicts.get(slot.number)
            if verdict:
                entry |= {"seconds": round(verdict.seconds, 3), "tests_reaching": verdict.reaching}
            if verdict and verdict.test:
                executable = verdict.test.executable
                entry["caught_by"] = {
                    "package": executable.package,
                    "target": executable.target,
                    "test": verdict.test.name,
                    "how": verdict.how,
                }
            entries.append(entry)
        caught, counted = self.share()
        whole = {**self.about, "caught": caught, "counted": counted, "mistakes": entries}
        path.write_text(json.dumps(whole, indent=1) + "\n")
