"""A simulation as a game: the same source, under the rules of a challenge."""

from collections.abc import Callable
from pathlib import Path

from bags.runs.live import LiveRun
from dcmg.page.attack_forms import order_of
from dcmg.page.board import Board
from dcmg.page.challenge import Challenge, Referee
from dcmg.page.messages import Attack, Game, Outline
from dcmg.page.scores import best, keep
from dcmg.page.simulated import Simulated
from dcmg.page.source import RefusalError
from dgu_sim.attacks import KINDS
from dgu_sim.errors import AttackError, DguSimError
from dgu_sim.grid import Link


class Contest:
    """One game after the other.

    Args:
        challenge: The rules.
        name: Under which scores are kept.
        player: Whose they are.
        make: Makes the simulation of a game; it is made ready for the first attack here.
        scores: File of scores.
    """

    def __init__(
        self, challenge: Challenge, name: str, player: str, make: Callable[[], Simulated], scores: Path
    ) -> None:
        """Begin the first game."""
        self.challenge, self._name, self._player, self._make, self._scores = challenge, name, player, make, scores
        self.game_number = 0
        self.again()
        attacks = [one for one in self._game.outline.attacks if one.name in challenge.kinds]
        self.outline: Outline = self._game.outline.model_copy(
            update={
                "name": challenge.title,
                "about": challenge.story,
                "can": ["clock", "attack"],
                "attacks": attacks,
                "challenge": challenge.goal,
            }
        )

    @property
    def board(self) -> Board:
        """Of the present game."""
        return self._game.board

    @property
    def head(self) -> int:
        """The next step."""
        return self._game.head

    @property
    def over(self) -> bool:
        """Whether the present game is decided."""
        return self._referee.verdict in {"won", "lost"}

    def again(self) -> None:
        """Begin another game, where the monitors have learnt."""
        self._game = self._make()
        ready_sec = self._game.run.designs.settings.calibrated_sec
        self._game.advance(round((ready_sec + 1.0) / self.board.sampling_period_sec))
        self._referee = Referee(self.challenge, self.board)
        self._referee.look(set())
        self._kept = False
        self.game_number += 1

    def advance(self, steps: int) -> int:
        """Go on, judged a tenth of a second at a time."""
        made = 0
        while made < steps:
            count = min(steps - made, self.board.quick)
            made += self._game.advance(count)
            self._referee.look(self._game.run.cut)
        if self.over and not self._kept:
            self._kept = True
            self.board.say(
                self.head - 1, "note", f"{self._referee.verdict}: {self._referee.why}, {self._referee.score} points"
            )
            try:
                keep(self._scores, self._name, self._player, self._referee.score)
            except OSError as error:
                self.board.say(self.head - 1, "note", f"the score is not kept: {error.strerror} ({error.filename})")
        return made

    def seek(self, step: int) -> None:
        """Refuse; see `Simulated`."""
        self._game.seek(step)

    def fork(self) -> LiveRun:
        """Refuse: that would tell too much."""
        raise RefusalError("what if: not in a challenge")

    def attack(self, order: Attack) -> str:
        """See `Source`; the rules are held."""
        rules = self.challenge
        if self.over and order.action in {"start", "change"}:
            raise RefusalError("the game is over: play again")
        if order.action != "stop":
            if order.attack in KINDS and order.attack not in rules.kinds:
                raise RefusalError(f"{order.attack}: not in this challenge, expected one of {', '.join(rules.kinds)}")
            busy = (
                {link for one in self.board.attacks(self.head) for link in one.links}
                if order.action != "change"
                else set()
            )
            if rules.most_links is not None and len(busy | set(order.links)) > rules.most_links:
                raise RefusalError(
                    f"at most {rules.most_links} link(s) at a time in this challenge: stop the other first"
                )
            self._check_numbers(order)
        return self._game.attack(order)

    def _check_numbers(self, order: Attack) -> None:
        """See that no number is larger than the rules allow."""
        most = self.challenge.most
        for name, value in order_of(order)[1].items():
            for one in value if isinstance(value, list) else [value]:
                if most is not None and isinstance(one, int | float) and abs(one) > most:
                    raise RefusalError(f"{name} = {one:g}: expected at most {most:g} in this challenge")

    def cut(self, name: str, *, on: bool) -> str:
        """Let secondary control leave a link out, or take it in again; raises RefusalError."""
        if not self.challenge.defended:
            raise RefusalError("no defender in this challenge")
        try:
            link = Link.parse(name)
            position = self.board.links.index(link)
        except (ValueError, AttackError, DguSimError) as error:
            raise RefusalError(f"link {name}: expected a communication link of this run") from error
        (self._game.run.cut.add if on else self._game.run.cut.discard)(position)
        done = "left out of secondary control" if on else "taken in again"
        self.board.say(max(0, self.head - 1), "clock", f"link {name} is {done} by the defender", name)
        return f"{name} is {done}"

    def game(self) -> Game:
        """How it stands."""
        referee = self._referee
        return Game(
            verdict=referee.verdict,
            why=referee.why,
            moved_v=referee.moved,
            share=min(1.0, abs(referee.moved) / self.challenge.mean_voltage_v),
            left_sec=referee.left_sec,
            score=referee.score,
            best=[f"{score} {player}" for score, player in best(self._scores, self._name)] if self.over else [],
            cut=[str(self.board.links[one]) for one in sorted(self._game.run.cut)],
        )

    def close(self) -> None:
        """Nothing is held."""
