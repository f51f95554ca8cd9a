"""A challenge for teaching: its rules, and the referee who watches them."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dcmg.errors import CommandError
from dcmg.page.board import Board
from dgu_sim.yaml_limits import load_within_limits

_LASTING_SEC, _WON, _A_SECOND, _AN_HONEST_LINK = 0.2, 1000, 10, 50
Verdict = Literal["ready", "running", "won", "lost"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Challenge(BaseModel):
    """The rules; a file in `dcmg/challenges`, or one's own.

    Attributes:
        title: A few words.
        story: What is to be done, and with what.
        scenario: What runs.
        changes: What is changed in it.
        mean_voltage_v: By how much the mean voltage is to move [V].
        within_sec: How long that may take from the first attack on [s].
        kinds: Kinds of attack that may be used.
        most_links: Links that may be attacked at a time; None: all.
        most: No number of an attack may be larger; None: any may.
        silent: An alarm loses.
        blind: The attacker does not see what the monitors see, before the end.
        defended: A second browser may leave links out.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    story: str
    scenario: str
    changes: tuple[str, ...] = ()
    mean_voltage_v: Positive
    within_sec: Positive
    kinds: tuple[str, ...]
    most_links: Annotated[int, Field(ge=1)] | None = None
    most: Positive | None = None
    silent: bool
    blind: bool = False
    defended: bool = False

    @property
    def goal(self) -> str:
        """What is to be reached, in a line."""
        quiet = " without an alarm" if self.silent else ""
        return f"move the mean voltage by {self.mean_voltage_v:g} V within {self.within_sec:g} s{quiet}"


def shipped() -> dict[str, Path]:
    """The challenges that come with this package, by name."""
    folder = Path(str(files("dcmg").joinpath("challenges")))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_challenge(name: str) -> Challenge:
    """Read a shipped challenge, or a file.

    Raises:
        CommandError: There is none, or it is not valid: one line.
    """
    path = shipped().get(name, Path(name))
    try:
        return Challenge.model_validate(load_within_limits(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise CommandError(f"--challenge {name}: expected one of {', '.join(shipped())}, or a file") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise CommandError(f"--challenge {name}: {' '.join(str(error).split())}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise CommandError(f"--challenge {name}: {where}: {first['msg']}, found {first['input']!r}") from error


class Referee:
    """Watches one game on a board that grows.

    Args:
        challenge: The rules.
        board: Of the game.
    """

    def __init__(self, challenge: Challenge, board: Board) -> None:
        """Wait for the first attack."""
        self._rules, self._board = challenge, board
        self.verdict: Verdict = "ready"
        self.why = "the clock starts with the first attack"
        self.moved = 0.0
        self._began = self._seen = self._ended = 0
        self._base = 0.0
        self._honest_cut = 0

    @property
    def left_sec(self) -> float:
        """Time that is left [s]."""
        if self.verdict == "ready":
            return self._rules.within_sec
        end = self._seen if self.verdict == "running" else self._ended
        return max(0.0, self._rules.within_sec - (end - self._began) * self._board.sampling_period_sec)

    @property
    def score(self) -> int:
        """Points of the attacker so far."""
        share = min(1.0, abs(self.moved) / self._rules.mean_voltage_v)
        if self.verdict == "lost" and self._rules.silent and "alarm" in self.why:
            return 0
        won = self.verdict == "won"
        return round(_WON * share) + won * round(_A_SECOND * self.left_sec) + _AN_HONEST_LINK * self._honest_cut

    def look(self, cut: set[int]) -> None:
        """Take the steps since the last look.

        Args:
            cut: Positions of the links that the defender leaves out now.
        """
        board, first = self._board, self._seen
        last = self._seen = board.trace.end
        if self.verdict in {"won", "lost"} or last == first:
            return
        attacked = board.trace.span(board.channels.link("attacked"), first, last)
        if self.verdict == "ready":
            if not attacked.any():
                return
            self._began = first + int(np.argmax(attacked.any(axis=0)))
            lasting = self._lasting(1.0)
            self._base = float(np.mean(self._mean(max(0, self._began - lasting), self._began)))
            self.verdict, self.why = "running", "the clock runs"
        self._judge(max(first, self._began), last, attacked[:, -1] > 0, cut)

    def _judge(
        self, first: int, last: int, attacked: "np.ndarray[tuple[int], np.dtype[np.bool_]]", cut: set[int]
    ) -> None:
        board, rules = self._board, self._rules
        lasting = self._lasting(_LASTING_SEC)
        mean = self._mean(max(0, last - lasting), last)
        self.moved = float(np.mean(mean)) - self._base
        alarm = board.trace.span(board.channels.link("alarm"), first, last)
        at = min(last, self._began + round(rules.within_sec / board.sampling_period_sec))
        if rules.silent and (alarm > 0).any():
            link = board.links[int(np.argmax((alarm > 0).any(axis=1)))]
            self._end("lost", f"alarm on link {link}", last)
        elif abs(self.moved) >= rules.mean_voltage_v:
            self._end("won", f"the mean voltage has moved by {self.moved:+.3f} V", last)
        elif at < last:
            self._honest_cut = len([one for one in cut if not attacked[one]])
            self._end("lost", "the time is over", at)

    def _end(self, verdict: Verdict, why: str, step: int) -> None:
        self.verdict, self.why, self._ended = verdict, why, step

    def _mean(self, first: int, last: int) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
        values = self._board.trace.span(self._board.channels.dgu("voltage"), first, last)
        return np.asarray(values.mean(axis=0))

    def _lasting(self, seconds: float) -> int:
        return max(1, round(seconds / self._board.sampling_period_sec))
