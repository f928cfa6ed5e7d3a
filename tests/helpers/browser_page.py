"""An explorer page in Chromium: waiting for what it does, and counting it."""

from collections import Counter

PATIENCE_MS = 240_000  # only against waiting for ever; a busy machine may take its time


def settle(page):
    """Let the page draw what it has been told: all in sight at once, be it more than a frame's work."""
    page.evaluate(
        "() => { const now = performance.now; performance.now = () => 0; "
        "rsmkit.state.flush(); rsmkit.charts.start(); performance.now = now; }"
    )
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def show(page, selector):
    """Scroll a chart into view and wait until it has been drawn."""
    page.locator(selector).first.scroll_into_view_if_needed()
    page.wait_for_function("(s) => document.querySelector(s)?.dataset.drawn", arg=selector)


def finish(page):
    """Wait until the page has started: what it does when idle, and every chart in sight."""
    page.wait_for_function("typeof Plotly === 'object'")
    page.evaluate("new Promise((done) => requestIdleCallback(done))")  # after the page's own
    page.wait_for_function(
        "[...document.querySelectorAll('.chart')].every((e) => e.dataset.drawn || !e.checkVisibility() || "
        "e.getBoundingClientRect().top > innerHeight)"
    )
    settle(page)


def address(page):
    """The fragment of the address, once the page has written its state there."""
    page.wait_for_function("location.hash === rsmkit.state.hash()")
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
