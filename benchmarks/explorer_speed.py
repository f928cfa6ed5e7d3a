"""Cost of loading and of dragging in the explorer, against floors measured in the same page, in one run.

Usage: python benchmarks/explorer_speed.py [CHROMIUM]

The study has three Gaussian processes of 300 runs in ten factors. Times are those of the page's main thread,
by Chromium's own count of processor time. The floor of a drag is a bare loop, in the same page, over the
surfaces at the points that its profiles, bands and contours show; the floor of loading is the same
page that only reads its data.
"""

import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
from playwright.sync_api import sync_playwright

from rsmkit.language.space import Factor, Space
from rsmkit.report.explorer.explorer_page import write_explorer
from rsmkit.report.findings import Findings
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.surfaces.estimation.coordinates import hull
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface

FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")
DRAGS = 12
READ = "<script>JSON.parse(data.textContent); document.documentElement.dataset.ready = true;</script>"
# What the page does in a frame, Chromium counts as script; what it is asked from outside, it does not.
FRAMES = """(value) => new Promise((done) => {{
  let n = 0;
  const next = () => {{ if (n === 0) work(value); n++ < 6 ? requestAnimationFrame(next) : done(); }};
  const work = {};
  requestAnimationFrame(next);
}})"""
DRAG = FRAMES.format("(value) => rsmkit.state.setFactor(rsmkit.data.factors.length - 1, value)")
# The profiles along all factors but the last, which is dragged, with their bands, and the contours' slice.
FLOOR = FRAMES.format("""(value) => {
  const { factors } = rsmkit.data, { quantities } = rsmkit.study;
  const places = (f, n) => Array.from({ length: n }, (_, i) => f.low + (f.high - f.low) * i / (n - 1));
  const point = rsmkit.state.point.slice();
  point[factors.length - 1] = value;
  for (const quantity of quantities) {
    factors.slice(0, -1).forEach((factor, j) => {
      quantity.values(point, j, places(factor, 43));
      quantity.intervals(point, j, places(factor, 8));
    });
  }
  const xs = places(factors[0], 25);
  for (const y of places(factors[1], 25)) { point[1] = y; quantities[0].values(point, 0, xs); }
}""")


def study():
    rng = np.random.default_rng(8)
    space = Space([Factor(f"x{j}", -1.0, 1.0 + j) for j in range(10)])
    points = rng.uniform(space.lows, space.highs, (300, 10))
    z = space.encode(points)
    observed = {name: z @ rng.normal(size=10) + np.sin(z @ rng.normal(size=10)) for name in ("u", "v", "w")}
    surfaces = {
        name: FittedResponse(
            GaussianProcessSurface(
                space, name, hull(space, points), FitData(points, y), "matern52", np.full(10, 1.5), 1.3, 1e-4
            )
        )
        for name, y in observed.items()
    }
    made = []
    for i, point in enumerate(points):
        responses = {name: float(y[i]) for name, y in observed.items()}
        made.append(Run(str(i), "benchmark", {}, space.values(point), 0, "done", responses, {}, 0.1))
    return Findings("Large", Runs(space, points, tuple(made), tuple(observed)), surfaces)


class Clock:
    """Processor time of a page's main thread, in seconds; what else the machine does is not in it."""

    def __init__(self, page):
        self._session = page.context.new_cdp_session(page)
        self._session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def read(self, name):
        """One of Chromium's metrics."""
        return {m["name"]: m["value"] for m in self._session.send("Performance.getMetrics")["metrics"]}[name]

    def script_seconds(self, page, script, value):
        """Script time until what `script` promises has happened."""
        before = self.read("ScriptDuration")
        page.evaluate(script, value)
        return self.read("ScriptDuration") - before


def loading(browser, path):
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    clock = Clock(page)
    page.goto(f"file://{path}")
    page.wait_for_selector("html[data-ready]")
    seconds = clock.read("TaskDuration")
    page.close()
    return seconds


def drags(browser, path):
    """Script time of every drag in a fresh page, and of a floor after each."""
    page = browser.new_page(viewport={"width": 880, "height": 9000})
    page.goto(f"file://{path}")
    page.wait_for_selector("html[data-ready]")
    page.locator("#contours .chart").first.scroll_into_view_if_needed()
    page.wait_for_function("document.querySelector('#contours .chart').dataset.drawn")
    page.evaluate("new Promise((done) => requestIdleCallback(() => requestAnimationFrame(done)))")
    low, high = page.evaluate("(({ low, high }) => [low, high])(rsmkit.data.factors.at(-1))")
    values = np.linspace(low, high, DRAGS + 2)[1:-1].tolist()
    clock = Clock(page)
    pairs = [[clock.script_seconds(page, script, value) for script in (DRAG, FLOOR)] for value in values]
    page.close()
    return zip(*pairs, strict=True)


def main(chromium="/usr/bin/chromium"):
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        explorer, bare = Path(folder) / "explorer.html", Path(folder) / "bare.html"
        write_explorer(explorer, study())
        text = explorer.read_text(encoding="utf-8")
        bare.write_text(text.replace("<script>rsmkit.start();</script>", READ), encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        loaded, alone = (median(loading(browser, path) for _ in range(5)) for path in (explorer, bare))
        (first, *later), floors = drags(browser, explorer)
        browser.close()
    floor = median(floors)
    print(f"load the explorer    {1e3 * loaded:7.0f} ms  {loaded / alone:5.2f} times reading its data alone")
    print(f"surfaces alone       {1e3 * floor:7.1f} ms  the floor of a drag")
    print(f"first drag           {1e3 * first:7.1f} ms  {first / floor:5.2f} times the floor")
    print(f"later drags (median) {1e3 * median(later):7.1f} ms  {median(later) / floor:5.2f} times the floor")


if __name__ == "__main__":
    main(*sys.argv[1:])
