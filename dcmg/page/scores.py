"""Scores of challenges, a line each in a file of the user's."""

import json
import os
import time
from pathlib import Path


def scores_path() -> Path:
    """Where scores are kept unless somebody says otherwise."""
    base = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(base) / "dcmg" / "scores.jsonl"


def keep(path: Path, challenge: str, player: str, score: int) -> None:
    """Append a score; raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    line = {"challenge": challenge, "player": player, "score": score, "at": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")


def best(path: Path, challenge: str, count: int = 5) -> list[tuple[int, str]]:
    """The best scores of a challenge with who has them; lines that are none are left out."""
    found = []
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    for line in lines:
        try:
            one = json.loads(line)
            if one["challenge"] == challenge:
                found.append((int(one["score"]), str(one["player"])))
        except (ValueError, KeyError, TypeError):
            continue
    return sorted(found, key=lambda one: -one[0])[:count]
