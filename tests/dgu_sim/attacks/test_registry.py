"""Attack classes by name."""

import pytest

from dgu_sim.attacks import KINDS, Attack, Bias, build_attack
from dgu_sim.errors import AttackError


def test_every_kind_is_an_attack() -> None:
    """The registry holds concrete attack classes."""
    for attack in KINDS.values():
        assert issubclass(attack, Attack)
        assert not attack.__abstractmethods__


def test_parameters_are_checked_and_kept() -> None:
    """Right parameters make the attack."""
    attack = build_attack("bias", {"bias": [0.1, 0.2, 0.3]})
    assert isinstance(attack, Bias)
    assert attack.bias == (0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("kind", "parameters", "said"),
    [
        ("bais", {}, "kind = 'bais': expected an attack class, one of bias"),
        ("bias", {}, "bias attack: bias: this key is missing"),
        ("bias", {"bias": [1.0, 2.0]}, "bias attack: bias = [1.0, 2.0]: expected 3 numbers"),
        ("bias", {"bias": [1.0, 2.0, "x"]}, "bias attack: bias.2 = 'x': expected a valid number"),
        ("bias", {"bias": [0.0, 0.0, float("inf")]}, "bias attack: bias.2 = inf: expected a finite number"),
        ("bias", {"bias": [0.0, 0.0, 0.0], "gain": 1}, "bias attack: gain = 1: no such key"),
    ],
)
def test_wrong_parameters_give_one_line(kind: str, parameters: dict[str, object], said: str) -> None:
    """What is wrong is named with its value, in one line."""
    with pytest.raises(AttackError) as caught:
        build_attack(kind, parameters)
    assert str(caught.value).startswith(said)
    assert "\n" not in str(caught.value)
