"""The page in a real browser: what a person sees and does, with a clean console."""

from __future__ import annotations

import re
import shutil
import time
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from bags.runs.reader import read_run

pytest.importorskip("playwright", reason="no Playwright here: pip install 'dcmg[dev]'")

from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
OPTIONS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
SHOWN = """(wanted) => {
    const text = document.querySelector("#link-numbers tbody tr td:nth-child(2)").textContent;
    return Math.abs(Number(text) - wanted) <= 6e-3 * Math.abs(wanted);
}"""
expect.set_options(timeout=60_000)  # a machine that is busy with other tests draws late
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium here: apt-get install chromium")


@pytest.fixture(name="browser", scope="module")
def _browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=BROWSER, args=OPTIONS)
        yield opened
        opened.close()


@pytest.fixture(name="address", scope="module")
def _address(serving: Callable[..., AbstractContextManager[str]]) -> Iterator[str]:
    with serving("gallo_six_dgu", "--set", "attacks=[]", "--rate", "4") as address:
        yield address


@pytest.fixture(name="look")
def _look(browser: Browser) -> Iterator[Callable[[str], Page]]:
    """Open an address in a window of its own; in the end nobody may have complained."""
    said: list[str] = []

    def complain(message: ConsoleMessage) -> None:
        if message.type in {"error", "warning"}:
            said.append(message.text)

    pages = []

    def look(address: str) -> Page:
        page = browser.new_page(viewport={"width": 1440, "height": 1100})
        page.set_default_timeout(60_000)
        page.on("console", complain)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(address)
        pages.append(page)
        expect(page.locator("#link-state")).to_have_text("live", timeout=60_000)
        return page

    yield look
    for page in pages:
        page.close()
    assert said == []


def _step(page: Page) -> int:
    return int(page.locator("body").get_attribute("data-step") or 0)


def _until(page: Page, expression: str, argument: object = None) -> None:
    """Wait for the page; Playwright's own wait_for_function needs eval, which the page's policy forbids."""
    deadline = time.monotonic() + 60.0
    while not page.evaluate(expression, argument):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(20)


def _reaches(page: Page, step: int) -> None:
    _until(page, "step => Number(document.body.dataset.step) >= step", step)


def _command(page: Page, text: str) -> None:
    """Start or stop by the button of that name, and wait for what the server says."""
    page.get_by_role("button", name=text, exact=True).click()
    expect(page.locator("#verdict")).to_have_text(re.compile(rf"^{text.lower()}"))


def test_an_attack_by_hand_is_seen_on_its_link_alone(address: str, look: Callable[[str], Page], tmp_path: Path) -> None:
    """Charts move; 1 → 2 is attacked: that link alarms and no other, in both browsers; stopped, it clears."""
    page, other = look(address), look(address)
    _reaches(page, 300)  # the detectors have learnt
    before, picture = _step(page), page.locator("#voltage-plot canvas").screenshot()
    _reaches(page, before + 40)
    assert page.locator("#voltage-plot canvas").screenshot() != picture
    page.locator('[data-link="1-2"] .reach').dispatch_event("click")
    expect(page.locator("#link-title")).to_have_text("Link 1 → 2")
    expect(page.locator("#verdict")).to_have_text("can start on 1 → 2")
    page.locator('#parameters input[name="bias"]').fill("0.1, 0.1")
    expect(page.locator("#verdict")).to_have_class("no")
    expect(page.locator("#start")).to_be_disabled()
    page.locator('#parameters input[name="bias"]').fill("0.1, 0.1, 0.1")
    expect(page.locator("#verdict")).to_have_class("yes")
    page.get_by_role("button", name="Play it ahead").click()
    expect(page.locator("#foreseen li").last).to_have_text(re.compile("^alarm on 1 → 2 after"))
    expect(page.locator("body")).to_have_attribute("data-foreseen", re.compile(r"^\d+$"))
    _command(page, "Start")
    for one in (page, other):
        expect(one.locator('[data-link="1-2"]')).to_have_class(re.compile("alarm attacked"))
        expect(one.locator(".link.alarm")).to_have_count(1)
        expect(one.locator(".link.attacked")).to_have_count(1)
        expect(one.locator("#log li.alarm").first).to_contain_text("1 → 2")
    _pictures(page, tmp_path)
    _command(page, "Stop")
    for one in (page, other):
        expect(one.locator(".link.alarm, .link.attacked")).to_have_count(0)


def test_time_obeys(address: str, look: Callable[[str], Page]) -> None:
    """Pause, one step, ten, another rate, go on: by button and by key, and another browser sees the same step."""
    page, other = look(address), look(address)
    page.locator("#play").click()
    expect(page.locator("#play")).to_have_text("Go on")
    at = _step(page)
    page.keyboard.press(".")
    expect(page.locator("body")).to_have_attribute("data-step", str(at + 1))
    page.keyboard.press("Shift+>")
    expect(page.locator("body")).to_have_attribute("data-step", str(at + 11))
    expect(other.locator("body")).to_have_attribute("data-step", str(at + 11))
    page.locator("#rate").select_option("10")
    expect(other.locator("#rate")).to_have_value("10")
    other.locator("h1").click()
    other.keyboard.press("-")
    expect(page.locator("#rate")).to_have_value("10")  # it has the focus there: nothing is changed under one's hands
    expect(other.locator("#rate")).to_have_value("5")
    other.keyboard.press(" ")
    _reaches(page, at + 100)


def test_everything_is_reached_by_keyboard_and_is_large_enough(address: str, look: Callable[[str], Page]) -> None:
    """Links have names and take Enter; j chooses the next; no letter is below 12 px; 390 px are wide enough."""
    page = look(address)
    link = page.locator('[data-link="4-5"]')
    expect(link).to_have_attribute("aria-label", re.compile("^Link 4 → 5: "))
    link.focus()
    page.keyboard.press("Enter")
    expect(page.locator("#link-title")).to_have_text("Link 4 → 5")
    page.keyboard.press("j")
    expect(page.locator("#link-title")).to_have_text("Link 6 → 5")
    page.keyboard.press("?")
    expect(page.locator("#keys")).to_be_visible()
    page.keyboard.press("Escape")
    page.keyboard.press("a")
    expect(page.locator("#kind")).to_be_focused()
    small = """[...document.querySelectorAll("body *")].filter((one) => one.textContent.trim() &&
        parseFloat(getComputedStyle(one).fontSize) < 12).map((one) => one.outerHTML.slice(0, 80))"""
    assert page.evaluate(small) == []
    page.set_viewport_size({"width": 390, "height": 844})
    _until(page, "document.documentElement.scrollWidth <= 390")
    drawn = """() => [...document.querySelectorAll("#graph text")].every(
        (one) => parseFloat(getComputedStyle(one).fontSize) * one.getScreenCTM().a >= 12)"""
    _until(page, drawn)


def test_both_sides_check_with_one_schema(address: str, look: Callable[[str], Page]) -> None:
    """The browser's checker knows what the server's models know: it names the place of what does not fit."""
    page = look(address)
    check = """async (message) => {
        const { fault } = await import("/static/check.js");
        return fault(message, (await (await fetch("/schema.json")).json()).client);
    }"""
    good = {"kind": "clock", "id": 1, "action": "rate", "rate": 2}
    assert page.evaluate(check, good) == ""
    for change in ({"action": "rest"}, {"rate": "2"}, {"id": 1.5}, {"more": 1}, {"kind": "clok"}):
        assert page.evaluate(check, {**good, **change}) != ""


def test_a_recorded_run_is_scrubbed(
    serving: Callable[..., AbstractContextManager[str]], look: Callable[[str], Page]
) -> None:
    """Any moment has the numbers of the bag: the residual that the report knows, the alarm on the attacked link."""
    path = Path(str(files("bags.golden"))) / "biased"
    record = read_run(path)
    link = record.attack_intervals
    attacked = next(one for one in record.links if link(one))
    ((start, stop), *_) = link(attacked)
    place, shown = record.links.index(attacked), min(stop, record.steps) - 1
    with serving(str(path), "--paused") as address:
        page = look(address)
        page.locator(f'[data-link="{attacked}"]').focus()
        page.keyboard.press("Enter")
        for step in (shown, start - 5, shown):
            page.locator("#scrub").fill(str(step + 1))
            expect(page.locator("body")).to_have_attribute("data-step", str(step + 1))
            _until(page, SHOWN, float(record.residual[step, place, 0]))
            expect(page.locator(f'[data-link="{attacked}"].attacked')).to_have_count(int(step == shown))


def test_a_moment_of_a_recorded_run_is_forked(
    serving: Callable[..., AbstractContextManager[str]], look: Callable[[str], Page]
) -> None:
    """What if, from the middle of a bag: a band stands beside the truth, and is forgotten on demand."""
    with serving(str(Path(str(files("bags.golden"))) / "biased"), "--paused") as address:
        page = look(address)
        page.locator("#scrub").fill("80")
        expect(page.locator("body")).to_have_attribute("data-step", "80")
        expect(page.locator("#start")).to_be_hidden()
        page.get_by_role("button", name="Play it ahead").click()
        expect(page.locator("body")).to_have_attribute("data-foreseen", "80")
        page.get_by_role("button", name="Forget").click()
        expect(page.locator("#foreseen")).to_be_hidden()


def test_a_duel_in_two_browsers(
    serving: Callable[..., AbstractContextManager[str]], look: Callable[[str], Page], tmp_path: Path
) -> None:
    """The attacker sees no monitor, the defender no attack but its alarm, and leaves the link out."""
    with serving("--challenge", "duel", "--player", "ada", "--scores", str(tmp_path / "scores")) as address:
        attacker, defender = look(address), look(f"{address}defender")
        for page in (attacker, defender):
            expect(page.locator("#goal")).to_contain_text("move the mean voltage by 0.5 V")
        expect(attacker.locator("#heat-box")).to_be_hidden()
        expect(defender.locator("#attack")).to_be_hidden()
        attacker.locator('[data-link="1-2"]').focus()
        attacker.keyboard.press("Enter")
        attacker.locator('#parameters input[name="bias"]').fill("0 3 0")
        _command(attacker, "Start")
        expect(attacker.locator("#game-verdict")).to_have_text("Running")
        expect(attacker.locator(".link.hidden.attacked")).to_have_count(1)
        expect(defender.locator('[data-link="1-2"]')).to_have_class(re.compile("alarm"))
        expect(defender.locator(".link.attacked")).to_have_count(0)
        defender.locator('[data-link="1-2"]').focus()
        defender.keyboard.press("Enter")
        defender.keyboard.press("x")
        for page in (attacker, defender):
            expect(page.locator('[data-link="1-2"]')).to_have_class(re.compile("left-out"))
        attacker.screenshot(path=tmp_path / "duel-attacker.png")
        defender.screenshot(path=tmp_path / "duel-defender.png")
        attacker.get_by_role("button", name="Play again").click()
        expect(attacker.locator("#game-verdict")).to_have_text("Ready")


def test_a_run_that_ends_is_told_and_comes_back(
    serving: Callable[..., AbstractContextManager[str]], browser: Browser
) -> None:
    """When nobody serves any more the page says so, and it shows the next run at the same address."""
    page = browser.new_page()
    with serving("isolated_dgu_1") as address:
        page.goto(address)
        expect(page.locator("#link-state")).to_have_text("live", timeout=60_000)
    expect(page.locator("#notice")).to_contain_text("ended", timeout=60_000)
    port = re.search(r":(\d+)/", address)
    assert port
    with serving("isolated_dgu_1", "--port", port[1]):
        expect(page.locator("#link-state")).to_have_text("live", timeout=60_000)
        expect(page.locator("#notice")).to_be_hidden()
    page.close()


def _pictures(page: Page, folder: Path) -> None:
    """Light, dark and narrow: something is drawn in each, and each has the brightness that was asked for."""
    for name, scheme, width in (("light", "light", 1440), ("dark", "dark", 1440), ("narrow", "light", 390)):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        page.set_viewport_size({"width": width, "height": 1100})
        _until(page, f"document.documentElement.scrollWidth <= {width}")
        assert len(page.screenshot(path=folder / f"page-{name}.png")) > 20_000
        luminance = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0]"
        assert (page.evaluate(luminance) < 60) == (scheme == "dark")
    page.set_viewport_size({"width": 1440, "height": 1100})
