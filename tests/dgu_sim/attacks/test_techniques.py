"""Attacks by their techniques of MITRE ATT&CK for ICS."""

import re
from pathlib import Path

from dgu_sim.attacks import KINDS
from dgu_sim.attacks.techniques import TECHNIQUES, techniques_of

PAGE = Path(__file__).parents[3] / "docs" / "attacks.md"


def test_every_kind_has_its_techniques() -> None:
    """Each shipped kind is named in the language of security; one of somebody else has none."""
    assert set(TECHNIQUES) == set(KINDS)
    assert all(TECHNIQUES.values())
    assert techniques_of("sign_flip") == ()
    ids = {one.id for found in TECHNIQUES.values() for one in found}
    assert all(re.fullmatch(r"T0\d{3}", one) for one in ids)


def test_the_page_has_the_same_table() -> None:
    """docs/attacks.md says of every technique which kinds are one."""
    text = PAGE.read_text()
    for technique in {one for found in TECHNIQUES.values() for one in found}:
        (row,) = [line for line in text.splitlines() if line.startswith(f"| {technique} |")]
        kinds = [kind for kind, found in TECHNIQUES.items() if technique in found]
        assert set(re.findall(r"`(\w+)`", row)) == set(kinds)
