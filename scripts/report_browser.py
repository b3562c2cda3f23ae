#!/usr/bin/env python3
"""Looks at a benchmark's report in headless Chromium: report_browser.py REPORT.html SHOTS_DIR

Checks, at phone and desk width, in light and dark: no console messages, no request to the network,
nothing wider than the page, every technique in every plot, all images there, the slider follows the
mouse and the keyboard, a picked image is compared, the heat map is drawn. Leaves screenshots.

Needs chromium and chromedriver (Debian: chromium chromium-driver) and speaks WebDriver itself.
Without them it says so in one line and ends with 0.
"""

import base64
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request

WIDTHS = {"phone": (360, 780), "desk": (1200, 900)}
SCHEMES = ("light", "dark")


class Driver:
    """One browser, through the W3C WebDriver protocol."""

    def __init__(self, chromium, chromedriver):
        # Port 0: the driver picks a free one and says which.
        self.process = subprocess.Popen([chromedriver, "--port=0"], stdout=subprocess.PIPE, text=True)
        self.session = None
        for line in self.process.stdout:
            if "started successfully on port" in line:
                port = line.rsplit("port", 1)[1].strip(" .\n")
                break
        else:
            raise SystemExit("error: chromedriver did not start")
        self.base = f"http://127.0.0.1:{port}"
        options = {
            "binary": chromium,
            "args": ["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"],
        }
        capabilities = {
            "alwaysMatch": {
                "browserName": "chrome",
                "goog:chromeOptions": options,
                "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
            }
        }
        self.session = self.call("POST", "/session", {"capabilities": capabilities})["sessionId"]

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json"}
        request = urllib.request.Request(self.base + path, data, headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            text = json.load(error)["value"]["message"].splitlines()[0]
            raise SystemExit(f"error: {path}: {text}") from None

    def do(self, method, path, body=None):
        return self.call(method, f"/session/{self.session}{path}", body)

    def run(self, script, *arguments):
        return self.do("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def chrome(self, command, **parameters):
        return self.do("POST", "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def log(self, kind):
        return self.do("POST", "/se/log", {"type": kind})

    def close(self):
        if self.session:
            self.do("DELETE", "")
        self.process.terminate()
        self.process.wait()


class Report:
    """The checks; each that fails is kept."""

    def __init__(self, driver, folder):
        self.driver = driver
        self.folder = folder
        self.count = 0
        self.faults = []

    def expect(self, is_true, what):
        self.count += 1
        if not is_true:
            self.faults.append(what)

    def shot(self, name, **parameters):
        data = self.driver.chrome("Page.captureScreenshot", format="png", **parameters)["data"]
        (self.folder / f"{name}.png").write_bytes(base64.b64decode(data))

    def section(self, name, section):
        box = self.driver.run(
            "const b = document.getElementById(arguments[0]).getBoundingClientRect();"
            "return {x: 0, y: b.top + scrollY - 10, width: innerWidth,"
            " height: Math.min(b.height + 20, 6000), scale: 1}", section)
        self.shot(f"{name}-{section}", clip=box, captureBeyondViewport=True)

    def wait(self, script, what):
        for _ in range(100):
            if self.driver.run(script):
                return
            time.sleep(0.1)
        self.expect(False, f"{what} did not happen within 10 s")

    def look(self, url, width, height, scheme, name):
        driver = self.driver
        driver.chrome(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=2 if width < 600 else 1, mobile=width < 600,
        )
        feature = {"name": "prefers-color-scheme", "value": scheme}
        driver.chrome("Emulation.setEmulatedMedia", features=[feature])
        driver.log("performance")
        driver.do("POST", "/url", {"url": url})

        wide = driver.run("return document.documentElement.scrollWidth")
        self.expect(wide <= width, f"{name}: the page is {wide} wide, the window {width}")
        dark = driver.run("""
            const rgb = getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number);
            return rgb[0] + rgb[1] + rgb[2] < 384""")
        self.expect(dark == (scheme == "dark"), f"{name}: the page is {'dark' if dark else 'light'}")
        self.plots(name)
        self.images(name)
        self.shot(f"{name}-top")
        self.section(name, "summary")
        self.section(name, "matrix")
        groups = driver.run("return [...document.querySelectorAll('.group')].map(g => g.id)")
        self.expect(groups, f"{name}: there are no scenes")
        for number, group in enumerate(groups):
            self.viewer(name, group)
            if number == 0:
                driver.run(f"document.querySelector('#{group} details')?.setAttribute('open', '')")
                self.section(name, group)
        for entry in driver.log("browser"):
            self.expect(False, f"{name}: console: {entry['message']}")
        for entry in driver.log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                asked = message["params"]["request"]["url"]
                is_own = asked == url or asked.startswith("data:")
                self.expect(is_own, f"{name}: asks for {asked}")

    def plots(self, name):
        missing = self.driver.run("""
            const labels = [...document.querySelectorAll('#matrix thead th')].slice(1).map(th => th.textContent);
            const missing = [];
            for (const figure of document.querySelectorAll('#summary figure, .group .error-time')) {
              const holder = figure.closest('section');
              const failed = new Set([...document.querySelectorAll('[data-failed]')]
                .filter(e => holder.id === 'summary' || holder.contains(e)).map(e => e.dataset.failed));
              const plots = [...figure.querySelectorAll('svg.plot')].filter(svg => svg.getClientRects().length);
              if (plots.length !== 1) missing.push(`${holder.id}: ${plots.length} plots are shown`);
              for (const svg of plots) {
                const frame = svg.getBoundingClientRect();
                const marks = new Map([...svg.querySelectorAll('.mark')].map(m => [m.dataset.technique, m]));
                for (const label of labels) {
                  const mark = marks.get(label);
                  if (!mark) { if (!failed.has(label)) missing.push(`${holder.id}: ${label}`); continue; }
                  const text = mark.querySelector('text'), b = text.getBoundingClientRect();
                  if (text.textContent !== label || b.width < 1 || b.left < frame.left - 1 ||
                      b.right > frame.right + 1 || b.top < frame.top - 1 || b.bottom > frame.bottom + 1)
                    missing.push(`${holder.id}: the label of ${label} is cut off`);
                }
                if (!svg.querySelector('.front')) missing.push(`${holder.id}: no front`);
              }
            }
            if (!labels.length) missing.push('no techniques');
            return missing""")
        self.expect(not missing, f"{name}: plots: {missing}")

    def images(self, name):
        self.wait("return [...document.images].every(i => i.complete)", f"{name}: loading images")
        broken = self.driver.run(
            "return [...document.images].filter(i => !i.naturalWidth || !i.alt).map(i => i.id || i.className)")
        self.expect(not broken, f"{name}: images missing or without text: {broken}")

    def viewer(self, name, group):
        driver = self.driver
        find = f"document.querySelector('#{group} '+arguments[0])"
        # Into view, so that the mouse can reach it, and the heat map is drawn.
        box = driver.run(f"""
            const stage = document.querySelector('#{group} .stage');
            stage.scrollIntoView({{block: 'center', behavior: 'instant'}});
            const b = stage.getBoundingClientRect();
            return [b.left, b.top, b.width, b.height]""")
        left, top, wide, high = box
        self.expect(wide > 100 and high > 100, f"{name}: {group}: the stage is {wide} x {high}")
        middle = int(top + high / 2)

        def move(part):
            return {"type": "pointerMove", "duration": 40, "x": int(left + part * wide), "y": middle}

        def seen():
            over = driver.run(f"return getComputedStyle({find}).clipPath", ".over")
            return over, driver.run(f"return Number({find}.value)", ".cut")

        before = seen()
        drag = [move(0.5), {"type": "pointerDown", "button": 0}, move(0.4), move(0.25)]
        pointer = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}}
        driver.do("POST", "/actions", {"actions": [{**pointer, "actions": drag}]})
        during = seen()
        up = [{"type": "pointerUp", "button": 0}]
        driver.do("POST", "/actions", {"actions": [{**pointer, "actions": up}]})
        self.expect(before[0] != during[0], f"{name}: {group}: dragging leaves the clip at {before[0]}")
        self.expect(abs(during[1] - 25) < 2, f"{name}: {group}: dragged to 25 %, it is at {during[1]}")
        keys = [{"type": "keyDown", "value": "\ue014"}, {"type": "keyUp", "value": "\ue014"}] * 5
        driver.do("POST", "/actions", {"actions": [{"type": "key", "id": "keys", "actions": keys}]})
        self.expect(seen()[1] > during[1], f"{name}: {group}: the arrow key leaves the slider alone")

        picked = driver.run(f"""
            const picks = [...document.querySelectorAll('#{group} .pick')];
            const pick = picks[picks.length - 1];
            pick.click();
            const shown = document.querySelector('#{group} .under').src;
            return [pick.dataset.image, shown === document.getElementById(pick.dataset.image).src]""")
        self.expect(picked[1], f"{name}: {group}: a picked image is not compared")
        drawn = f"document.querySelector('#{group} canvas').dataset.drawn"
        self.wait(f"return {drawn} === '{picked[0]}'", f"{name}: {group}: drawing the heat map")
        shades = driver.run(f"""
            const canvas = document.querySelector('#{group} canvas');
            const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
            const isTruth = document.querySelector('#{group} .under').src ===
              document.getElementById('{group}-truth').src;
            return isTruth ? 2 : new Set(new Uint32Array(data.buffer)).size""")
        # Without any error it may well have one colour.
        self.expect(shades > 1, f"{name}: {group}: the heat map has {shades} colour(s)")


def main():
    if len(sys.argv) != 3:
        print("usage: report_browser.py REPORT.html SHOTS_DIR", file=sys.stderr)
        return 2
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    chromedriver = shutil.which("chromedriver")
    if not (chromium and chromedriver):
        print("skipped: no chromium and chromedriver here (Debian: chromium chromium-driver)")
        return 0
    page = pathlib.Path(sys.argv[1]).resolve()
    if not page.is_file():
        print(f"error: {page}: no such file", file=sys.stderr)
        return 1
    folder = pathlib.Path(sys.argv[2])
    os.makedirs(folder, exist_ok=True)
    driver = Driver(chromium, chromedriver)
    report = Report(driver, folder)
    try:
        for place, (width, height) in WIDTHS.items():
            for scheme in SCHEMES:
                report.look(page.as_uri(), width, height, scheme, f"{place}-{scheme}")
    finally:
        driver.close()
    for fault in report.faults:
        print(f"FAILED {fault}")
    print(f"{report.count} checks, {len(report.faults)} failed; screenshots in {folder}")
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())
