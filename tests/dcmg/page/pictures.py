"""The pictures of the page, and the animation of an attack: `python -m tests.dcmg.page.pictures FOLDER`."""

from __future__ import annotations

import io
import re
import shutil
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Page, expect, sync_playwright

from tests.dcmg.page.serving import serving_page

OPTIONS = ("--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking", "--disable-sync")
# a grid whose monitors have noise to live with, so that a residual is something to look at
NOISY = ("--set", "noise={kind: gaussian, std: [0.01, 0.01, 0.001]}", "--set", "attacks=[]", "--paused")
FRAMES, FRAME_MS, STEPS_A_FRAME = 44, 160, 14


def _step(page: Page, steps: int) -> None:
    """Make steps and wait until they are drawn."""
    before = int(page.locator("body").get_attribute("data-step") or 0)
    page.evaluate("steps => window.dcmg.command({kind: 'clock', action: 'step', steps})", steps)
    expect(page.locator("body")).to_have_attribute("data-step", str(before + steps))


def _attack(page: Page, button: str) -> None:
    page.get_by_role("button", name=button, exact=True).click()
    expect(page.locator("#verdict")).to_have_text(re.compile(f"^{button.lower()}"))


def _open(page: Page, address: str) -> None:
    page.goto(address)
    expect(page.locator("#link-state")).to_have_text("live")
    _step(page, 900)
    page.locator('[data-link="1-2"]').focus()
    page.keyboard.press("Enter")
    page.locator("#graph").evaluate("one => document.activeElement.blur()")


def _stills(page: Page, address: str, folder: Path) -> None:
    page.set_viewport_size({"width": 1440, "height": 1500})
    _open(page, address)
    _attack(page, "Start")
    _step(page, 250)
    page.get_by_role("button", name="Play it ahead").click()
    expect(page.locator("#foreseen li").first).to_be_visible()
    for name, scheme, width, height in (
        ("page", "light", 1440, 1240),
        ("page-dark", "dark", 1440, 1240),
        ("page-narrow", "light", 390, 1500),
    ):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("scrollTo(0, 0)")
        _step(page, 1)
        page.wait_for_timeout(600)  # the plots take their new width
        page.screenshot(path=folder / f"{name}.png")


def _animation(page: Page, address: str, folder: Path) -> None:
    page.emulate_media(color_scheme="light")
    page.set_viewport_size({"width": 1180, "height": 640})
    _open(page, address)
    pictures = []
    for number in range(FRAMES):
        if number == FRAMES // 4:
            _attack(page, "Start")
        if number == 3 * FRAMES // 4:
            _attack(page, "Stop")
        page.evaluate("scrollTo(0, 0)")
        _step(page, STEPS_A_FRAME)
        shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB").resize((885, 480))
        pictures.append(shot)
    palette = _palette(pictures[FRAMES // 2])
    pictures = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    pictures[0].save(
        folder / "page.gif", save_all=True, append_images=pictures[1:], duration=FRAME_MS, loop=0, optimize=True
    )


def _palette(picture: Image.Image) -> Image.Image:
    """The colours of a moment under attack: the most frequent ones as they are, and of the others rare ones, too."""
    colours, counts = np.unique(np.asarray(picture).reshape(-1, 3), axis=0, return_counts=True)
    frequent = colours[np.argsort(-counts)[:60]].ravel().tolist()
    rest = picture.quantize(colors=150, method=Image.Quantize.MAXCOVERAGE).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([*frequent, *rest[: 3 * 150]])
    return palette


def main(folder: Path) -> None:
    """Make them all."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=OPTIONS)
        for make in (_stills, _animation):
            with serving_page("gallo_six_dgu", *NOISY) as address:
                page = browser.new_page()
                make(page, address, folder)
                page.close()
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
