"""An explorer page in Chromium: waiting for what it does, and counting it."""

import os
import time
from collections import Counter

PATIENCE_MS = int(os.environ.get("RSMKIT_PATIENCE_MS", "240000"))  # a busy machine may take its time


def until(page, expression, argument=None):
    """Wait until an expression is true, without evaluating texts in the page, which its policy forbids."""
    latest = time.monotonic() + PATIENCE_MS / 1000
    while not page.evaluate(expression, argument):
        assert time.monotonic() < latest, expression
        page.wait_for_timeout(10)


def settle(page):
    """Let the page draw what it has been told: all in sight at once, be it more than a frame's work."""
    page.evaluate(
        "() => { const now = performance.now; performance.now = () => 0; "
        "rsmkit.state.flush(); rsmkit.charts.start(); performance.now = now; }"
    )
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def show(page, selector):
    """Choose the view that a chart is in, scroll to it and wait until it has been drawn."""
    choose(page, selector)
    page.locator(selector).first.scroll_into_view_if_needed()
    until(page, "(s) => document.querySelector(s)?.dataset.drawn", selector)


def choose(page, selector):
    """Choose the view that something is in."""
    page.evaluate(
        "(s) => rsmkit.views.choose(document.querySelector(s).closest('.view').id.replace('view-', ''))",
        selector,
    )


def finish(page):
    """Wait until the page has started: what it does when idle, and every chart in sight."""
    page.wait_for_selector("html[data-ready]")
    until(
        page,
        "[...document.querySelectorAll('.chart')].every((e) => e.dataset.drawn || !e.checkVisibility() || "
        "e.getBoundingClientRect().top > innerHeight)",
    )
    settle(page)


def address(page):
    """The fragment of the address, once the page has written its state there."""
    until(page, "location.hash === rsmkit.state.hash()")
    return page.evaluate("location.hash")


class Calls:
    """How often each function of the page's own scripts was called, by Chromium's own count.

    Keys are such as ``("models.js", "predict")``. Take it before a page is opened to count from the start.
    """

    def __init__(self, page):
        self._session = page.context.new_cdp_session(page)
        self._session.send("Profiler.enable")
        self._session.send("Profiler.startPreciseCoverage", {"callCount": True, "detailed": False})

    def take(self):
        """Calls since the last look."""
        calls = Counter()
        for script in self._session.send("Profiler.takePreciseCoverage")["result"]:
            folder, _, name = script["url"].rpartition("/")
            if folder == "rsmkit":
                for function in script["functions"]:
                    calls[name, function["functionName"]] += function["ranges"][0]["count"]
        return calls


def patient_page(browser, **options):
    """New page, in a context of its own."""
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})
    context.set_default_timeout(PATIENCE_MS)
    return context.new_page()
