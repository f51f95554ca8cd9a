"""A bag is damaged: check says so, and what repair brings back every reader decodes, and was recorded."""

from __future__ import annotations

import random
import shutil
import time
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bags.mcap.check import check
from bags.mcap.errors import BagError
from bags.mcap.repair import repair
from tests.torture.originals import Message, Original, files_of, messages_of, originals
from tests.torture.outcome import Outcome
from tests.torture.readers import refused_by

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

JUDGED_SEC = 10.0
_HEAVY = "dcmg, a run"
_HEAVY_SHARE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """What was done to one file of a bag.

    Attributes:
        data: what it holds now.
        what: in words.
        touched: chunks, by number, that were damaged themselves.
        defined: whether everything that says what messages are is as it was, at least once.
        in_place: whether bytes have other values, and all stand where they stood.
    """

    data: bytes
    what: str
    touched: frozenset[int]
    defined: bool = True
    in_place: bool = False


Chunks = tuple[tuple[int, int, tuple[Message, ...]], ...]


def _hit(chunks: Chunks, start: int, end: int) -> frozenset[int]:
    return frozenset(number for number, (begin, until, _) in enumerate(chunks) if begin < end and start < until)


def _flipped(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    """One to four wrong bits anywhere."""
    changed, places = bytearray(data), [rng.randrange(len(data)) for _ in range(rng.choice((1, 1, 2, 4)))]
    for at in places:
        changed[at] ^= 1 << rng.randrange(8)
    touched = frozenset().union(*(_hit(chunks, at, at + 1) for at in places))
    return Damage(
        data=bytes(changed), what=f"bits flipped at {places}", touched=touched, defined=len(places) == 1, in_place=True
    )


def _truncated(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    at = max(rng.randrange(len(data)), 1)  # an empty file is called what it is
    return Damage(data=data[:at], what=f"cut at {at}", touched=_hit(chunks, at, len(data)))


def _zeroed(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    """A page that the disk lost."""
    at = rng.randrange(len(data))
    end = min(at + rng.choice((16, 512, 4096)), len(data))
    changed = data[:at] + bytes(end - at) + data[end:]
    return Damage(
        data=changed,
        what=f"zeros from {at} to {end}",
        touched=_hit(chunks, at, end),
        defined=bool(chunks) and at > chunks[0][0],
        in_place=True,
    )


def _swapped(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    one, other = sorted(rng.sample(range(len(chunks)), 2))
    (a, b, _), (c, d, _) = chunks[one], chunks[other]
    changed = data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]
    return Damage(data=changed, what=f"chunks {one} and {other} swapped", touched=frozenset())


def _doubled(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    one, after = rng.randrange(len(chunks)), rng.randrange(len(chunks))
    (a, b, _), (_, at, _) = chunks[one], chunks[after]
    return Damage(
        data=data[:at] + data[a:b] + data[at:], what=f"chunk {one} once more behind chunk {after}", touched=frozenset()
    )


def _removed(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    one = rng.randrange(len(chunks))
    a, b, _ = chunks[one]
    return Damage(data=data[:a] + data[b:], what=f"chunk {one} removed", touched=frozenset({one}))


def _junk(rng: random.Random) -> bytes:
    return rng.choice((rng.randbytes(rng.randint(1, 5000)), b"\x89MCAP0\r\n", bytes(700), b"PK\3\4" * 50))


def _in_front(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    del chunks
    junk = _junk(rng)
    return Damage(data=junk + data, what=f"{len(junk)} bytes in front", touched=frozenset())


def _behind(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    del chunks
    junk = _junk(rng)
    return Damage(data=data + junk, what=f"{len(junk)} bytes behind", touched=frozenset())


def _killed(rng: random.Random, data: bytes, chunks: Chunks) -> Damage:
    """The recorder was killed, and a bit of a definition is wrong."""
    end = rng.choice([end for _, end, _ in chunks])
    cut = min(end + rng.choice((0, 0, 3, 40)), len(data) - 1)
    changed, at = bytearray(data[:cut]), rng.randrange(8, max(chunks[0][0], 9))
    changed[at] ^= 1 << rng.randrange(8)
    touched = _hit(chunks, end, len(data)) | _hit(chunks, at, at + 1)
    return Damage(data=bytes(changed), what=f"killed at {cut}, bit flipped at {at}", touched=touched, defined=False)


WAYS: Mapping[str, Callable[[random.Random, bytes, Chunks], Damage]] = {
    "flipped bits": _flipped,
    "truncated": _truncated,
    "zeros": _zeroed,
    "chunks swapped": _swapped,
    "chunk doubled": _doubled,
    "chunk removed": _removed,
    "junk in front": _in_front,
    "junk behind": _behind,
    "killed, definition flipped": _killed,
}


def damaged(seed: int, folder: Path) -> Outcome:
    """Do it, check, repair, and judge."""
    rng = random.Random(seed)  # noqa: S311 - no secret
    way = [*WAYS][seed % len(WAYS)]
    every = originals()
    light = [one for one in every if one.name != _HEAVY]
    heavy = [one for one in every if one.name == _HEAVY]
    original = rng.choice(heavy if rng.random() < _HEAVY_SHARE else light)
    while way == "chunks swapped" and all(len(chunks) < 2 for chunks in original.chunks.values()):
        original = rng.choice(light)
    bag = folder / f"damaged_{seed}"
    shutil.copytree(original.folder, bag)
    file = rng.choice(files_of(bag))
    chunks = original.chunks[file.name]
    sound = file.read_bytes()
    damage = WAYS[way](rng, sound, chunks)
    file.write_bytes(damage.data)
    begin = time.monotonic()
    out = folder / f"repaired_{seed}"
    try:
        broken, note = _judged(original, file.name, damage, bag, out, same=damage.data == sound)
    except Exception as error:  # noqa: BLE001 - anything but BagError is the finding
        broken, note = [f"{type(error).__name__}: {error}"], ""
    seconds = time.monotonic() - begin
    broken += [f"took {seconds:.0f} s"] if seconds > JUDGED_SEC else []
    shutil.rmtree(bag, ignore_errors=True)
    shutil.rmtree(out, ignore_errors=True)
    what = f"{original.name}: {file.name}: {damage.what}"
    return Outcome(kind="bags", seed=seed, what=what, row=way, broken=tuple(broken), seconds=seconds, note=note)


def _judged(
    original: Original, name: str, damage: Damage, bag: Path, out: Path, *, same: bool
) -> tuple[list[str], str]:
    broken = []
    unseen = damage.in_place and not original.checked  # nobody can tell what stood where there is no check sum
    if check(bag).clean and not same and not unseen:
        broken.append("check finds nothing")
    intact: Counter[Message] = Counter()
    for file, chunks in original.chunks.items():
        for number, (_, _, content) in enumerate(chunks):
            if file != name or number not in damage.touched:
                intact.update(content)
    try:
        report = repair(bag, out)
    except BagError as error:
        return [
            *broken,
            *([f"{intact.total()} messages lost: {error}"] if intact and damage.defined else []),
        ], "refused"
    refused = refused_by(out)
    if refused:
        return [*broken, refused], ""
    found = Counter(messages_of(out))
    invented = found - Counter(original.messages)
    lost = intact - found
    if invented and not unseen:
        broken.append(f"invented {invented.total()}: {next(iter(invented))}")
    if lost.total() > (0 if damage.defined else report.undescribed):
        broken.append(f"lost {lost.total()}, told {report.undescribed}: {next(iter(lost))}")
    after = check(out)
    if not after.clean:
        broken.append(f"repaired, and check says: {after.damages[0]}")
    return broken, "left out, told" if report.undescribed else ""
