"""Opens raycl's pages in Chromium, from files, as a reader does: points, clicks, types, looks for errors.

Usage: report.py SYNTHETIC RESULTS [REPRODUCTION [MICROSCOPE]]. SYNTHETIC and RESULTS are folders with report.html,
REPRODUCTION is a folder with reproduction.html, and MICROSCOPE is a page that `raycl compile` wrote. The environment
variable AXE names axe-core's axe.min.js. Screenshots are written to the folder that SHOTS names; without
SHOTS, most are written beside the pages. Needs Debian's chromium, chromium-driver and python3-selenium.
"""
import os
import sys
import time
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import Select


def browser(width=1280, height=900, dark=False):
    options = webdriver.ChromeOptions()
    flags = ["headless=new", "no-sandbox", "disable-gpu", "disable-dev-shm-usage", "no-first-run",
             "disable-background-networking", "hide-scrollbars", f"window-size={width},{height}"]
    for flag in flags:
        options.add_argument("--" + flag)
    if dark:
        options.add_argument("--blink-settings=preferredColorScheme=0")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)


def load(driver, page):
    start = time.monotonic()
    driver.get(page.resolve().as_uri())
    driver.execute_script("return document.body.offsetHeight")
    return time.monotonic() - start


def check_clean(driver, page):
    """Checks that a page logs no error, loads no other file, has no injected markup, and is not wider than the window."""
    errors = [entry for entry in driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
    assert not errors, f"{page}: {errors}"
    loaded = driver.execute_script("return performance.getEntriesByType('resource').map(e => e.name).filter(n => !n.startsWith('data:'))")
    assert not loaded, f"{page} loads {loaded}"
    assert driver.execute_script("return window.injected") is None, f"{page}: a name became a script"
    assert not driver.find_elements(By.CSS_SELECTOR, "[onerror], [onload], main script"), f"{page}: markup was injected"
    wide = driver.execute_script("return document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0, f"{page} is {wide} pixels too wide"


def check_phone(driver, page):
    """Checks that every plot and its legend fit into the window, and that no plot scrolls sideways."""
    said = driver.execute_script("""
        const out = [], seen = e => e.getClientRects().length > 0, edge = document.documentElement.clientWidth + 0.5;
        for (const svg of document.querySelectorAll('svg.chart')) {
            if (!seen(svg)) continue;
            const box = svg.getBoundingClientRect(), name = svg.getAttribute('aria-label');
            if (box.left < -0.5 || box.right > edge) out.push(`${name}: from ${box.left} to ${box.right}`);
            const around = svg.parentElement;
            if (around.scrollWidth > around.clientWidth + 1) out.push(`${name}: scrolls sideways`);
            for (const part of svg.querySelectorAll('text, .mark, .entry')) {
                const own = part.getBoundingClientRect();
                if (own.width > 0 && (own.left < box.left - 2 || own.right > box.right + 2))
                    out.push(`${name}: '${part.textContent.slice(0, 60)}' is cut off`);
            }
        }
        return [out, [...document.querySelectorAll('svg.chart')].filter(seen).length]""")
    assert said[1] > 0 and not said[0], f"{page}, as wide as a phone: {said[0]}"


def check_contrast(driver, page, look):
    """Checks that axe-core finds no text with too little contrast."""
    driver.set_script_timeout(300)
    driver.execute_script(Path(os.environ["AXE"]).read_text())
    found = driver.execute_async_script("""
        const done = arguments[arguments.length - 1];
        axe.run(document, {runOnly: ['color-contrast']}).then(
            r => done(r.violations.flatMap(v => v.nodes.map(n => `${n.target}: ${n.any.map(a => a.message)}`))),
            e => done([String(e)]))""")
    assert not found, f"{page}, {look}: {found[:10]}"


def tip(driver):
    found = driver.find_element(By.ID, "tip")
    return found.text if found.is_displayed() else ""


def bring(driver, element, focus=False):
    """Scrolls to an element, and waits for the scrolling's own events, which hide the tip."""
    driver.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", element)
    if focus:
        driver.execute_script("arguments[0].focus()", element)
    time.sleep(0.25)


def press(driver, selector):
    """Clicks an element. Scrolls to it first, so that the bar at the top does not cover it."""
    element = driver.find_element(By.CSS_SELECTOR, selector)
    bring(driver, element)
    element.click()


def point_at(driver, element):
    """Moves the mouse to an element, by coordinates: a move to the element itself scrolls, and scrolling hides the tip."""
    bring(driver, element)
    x, y = driver.execute_script("const r = arguments[0].getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]", element)
    action = ActionBuilder(driver)
    action.pointer_action.move_to_location(int(x), int(y))
    action.perform()


def check_pointing(driver):
    mark = driver.find_element(By.CSS_SELECTOR, ".view:not([hidden]) .series .mark")
    point_at(driver, mark)
    text = tip(driver)
    for part in ("at ", "median ", "95% interval", "n = "):
        assert part in text, f"hover says only {text!r}"
    ActionChains(driver).send_keys(Keys.ESCAPE).perform()
    assert tip(driver) == "", "Escape leaves the tip"


def check_keyboard(driver):
    chart = driver.find_element(By.CSS_SELECTOR, ".view:not([hidden]) .plot.log svg.chart")
    bring(driver, chart, focus=True)
    said = []
    for key in (Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_DOWN):
        ActionChains(driver).send_keys(key).perform()
        said.append(tip(driver))
    assert all(said) and len(set(said)) > 1, f"arrow keys say {said}"
    entry = driver.find_element(By.CSS_SELECTOR, ".view:not([hidden]) .plot.log .entry")
    bring(driver, entry, focus=True)
    ActionChains(driver).send_keys(Keys.ENTER).perform()
    assert entry.get_attribute("aria-pressed") == "false", "Enter does not switch a series off"
    assert driver.find_elements(By.CSS_SELECTOR, ".view:not([hidden]) .series.off")
    bring(driver, entry)
    entry.click()


def check_reasons(driver):
    cells = driver.find_elements(By.CSS_SELECTOR, ".view:not([hidden]) .mark rect[fill^='url(#hatch']")
    assert cells, "no infeasible cell"
    point_at(driver, cells[0])
    assert "infeasible: __local memory" in tip(driver) or "failed" in tip(driver) or "wrong" in tip(driver), tip(driver)


def check_controls(driver):
    pick = Select(driver.find_element(By.ID, "pick"))
    pick.select_by_index(len(pick.options) - 1)
    shown = [view for view in driver.find_elements(By.CSS_SELECTOR, ".view") if view.is_displayed()]
    assert len(shown) == 1, f"{len(shown)} views are shown"
    press(driver, "[data-scale=linear]")
    assert shown[0].find_element(By.CSS_SELECTOR, ".plot.linear").is_displayed()
    assert not shown[0].find_element(By.CSS_SELECTOR, ".plot.log").is_displayed()
    press(driver, "[data-scale=log]")
    median = shown[0].find_elements(By.CSS_SELECTOR, "th button")[2]
    for descending in (False, True):
        driver.execute_script("arguments[0].click()", median)
        cells = shown[0].find_elements(By.CSS_SELECTOR, "tbody td:nth-child(3)")
        values = [float(cell.text) for cell in cells if cell.text]
        assert values == sorted(values, reverse=descending), "the table is not sorted"
    search = shown[0].find_element(By.CSS_SELECTOR, "input[type=search]")
    search.send_keys("naive 8x8")
    rows = [row for row in shown[0].find_elements(By.CSS_SELECTOR, "tbody tr") if row.is_displayed()]
    assert 1 <= len(rows) < 5, f"{len(rows)} rows after filtering"


def check_growth(driver):
    """The plot over triangles has exponents, and a legend's entry switches a series off together with its line."""
    chart = driver.find_element(By.CSS_SELECTOR, "svg.chart[aria-label^='Time against the number of triangles']")
    entry = chart.find_element(By.CSS_SELECTOR, ".entry")
    assert ": ^" in entry.get_attribute("data-tip"), "no exponent in the legend"
    number = entry.get_attribute("data-for")
    parts = chart.find_elements(By.CSS_SELECTOR, f".series[data-series='{number}']")
    assert len(parts) == 2, f"{len(parts)} parts: the marks and the fitted line are wanted"
    bring(driver, entry)
    for switched_off in (True, False):
        entry.click()
        assert all(("off" in part.get_attribute("class").split()) == switched_off for part in parts)


def check_environment(driver, command):
    text = driver.find_element(By.ID, "environment").text.lower()
    for part in (command, "git checkout", "input files", "clocks"):
        assert part in text, f"the environment has no {part!r}"


def check_gallery(driver):
    kinds = {kind.text for kind in driver.find_elements(By.CSS_SELECTOR, ".picture b")}
    wanted = {"reference", "uncertain pixels", "cost: triangles, without a tree", "cost: triangles, with a tree", "cost: nodes of a tree"}
    assert wanted <= kinds, f"no picture of {wanted - kinds}"
    assert any(kind.startswith("difference: ") for kind in kinds), "no picture of a difference"


def check_lightbox(driver):
    button = driver.find_element(By.CSS_SELECTOR, ".enlarge")
    bring(driver, button)
    button.click()
    box = driver.find_element(By.ID, "lightbox")
    assert box.is_displayed() and box.find_element(By.TAG_NAME, "img").size["width"] > 300
    first = box.find_element(By.TAG_NAME, "figcaption").text
    ActionChains(driver).send_keys(Keys.ARROW_RIGHT).perform()
    assert box.find_element(By.TAG_NAME, "figcaption").text != first, "the arrow key does not go on"
    driver.save_screenshot(os.environ.get("SHOTS", "/tmp") + "/lightbox.png")
    ActionChains(driver).send_keys(Keys.ESCAPE).perform()
    assert not box.is_displayed(), "Escape does not close the picture"
    bring(driver, button, focus=True)
    ActionChains(driver).send_keys(Keys.ENTER).perform()
    assert box.is_displayed(), "Enter does not enlarge the picture in focus"
    ActionChains(driver).send_keys(Keys.ESCAPE).perform()
    assert driver.switch_to.active_element == button, "the focus does not come back to the picture"


def screenshots(page, stem):
    folder = Path(os.environ.get("SHOTS", page.parent))
    looks = {"light": (1280, 900, False), "dark": (1280, 900, True), "phone": (390, 844, False)}
    for look, (width, height, dark) in looks.items():
        driver = browser(width, height, dark)
        try:
            if look == "phone":
                driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                                       {"width": width, "height": height, "deviceScaleFactor": 2, "mobile": True})
            load(driver, page)
            check_clean(driver, page)
            if look == "phone" and stem != "microscope":  # The microscope has no plots.
                check_phone(driver, page)
            if stem != "synthetic":  # axe-core would take minutes for the page's 2,000 points.
                check_contrast(driver, page, look)
            driver.save_screenshot(str(folder / f"{stem}-{look}.png"))
            plots = driver.find_elements(By.CSS_SELECTOR, ".view:not([hidden]) .plot, .claims")
            if plots:
                driver.execute_script("arguments[0].scrollIntoView({behavior: 'instant'})", plots[0])
                driver.save_screenshot(str(folder / f"{stem}-{look}-plots.png"))
        finally:
            driver.quit()


def printed(page, stem):
    """Checks the page as it is printed: every view, in light colours, without controls."""
    driver = browser(1000, 1400, dark=True)
    try:
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        load(driver, page)
        views = driver.find_elements(By.CSS_SELECTOR, ".view")
        assert all(view.is_displayed() for view in views), "a view is not printed"
        ground = driver.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert ground == "rgb(255, 255, 255)", f"paper is {ground}"
        assert not driver.find_element(By.CSS_SELECTOR, ".bar").is_displayed()
        if views:
            bring(driver, views[0].find_element(By.CSS_SELECTOR, ".plot"))
        driver.save_screenshot(str(Path(os.environ.get("SHOTS", page.parent)) / f"{stem}-print.png"))
    finally:
        driver.quit()


def check_microscope(driver, page):
    """A click on a line marks its instructions and scrolls to them; arrow keys go on from this line."""
    load(driver, page)
    line = driver.find_element(By.XPATH, "//ol[contains(@class, 'source')]/li[@data-line][contains(., 'at[0] = value.x')]")
    bring(driver, line)
    line.click()
    marked = driver.find_elements(By.CSS_SELECTOR, ".steps .same")
    assert marked and all(step.get_attribute("data-line") == line.get_attribute("data-line") for step in marked)
    shown = driver.execute_script("const p = arguments[0].closest('.pane'), t = arguments[0].offsetTop - p.scrollTop; return t >= 0 && t < p.clientHeight", marked[0])
    assert shown, "the line's first instruction is not scrolled to"
    following = line.find_element(By.XPATH, "following-sibling::li[@data-line][1]").get_attribute("data-line")

    def after_arrow_down(pane):
        driver.execute_script("arguments[0].focus()", driver.find_element(By.CSS_SELECTOR, pane))
        ActionChains(driver).send_keys(Keys.ARROW_DOWN).perform()
        return driver.find_element(By.CSS_SELECTOR, f"{pane} .now").get_attribute("data-line")

    now = after_arrow_down(".source")
    assert now == following, f"after a click, an arrow key marks line {now} and not line {following}"
    now = after_arrow_down(".steps")
    assert driver.find_elements(By.CSS_SELECTOR, f".source .same[data-line='{now}']"), "an arrow key marks no line"
    check_clean(driver, page)


def main(synthetic, results, reproduction=None, microscope=None):
    driver = browser()
    try:
        page = Path(synthetic) / "report.html"
        # The first load includes the browser's own start; the second one shows how long the page takes.
        first, seconds, size = load(driver, page), load(driver, page), page.stat().st_size
        print(f"2,000 points: {size / 1e6:.1f} MB, open after {seconds:.2f} s (first {first:.2f} s)")
        assert size < 15e6, f"{size} bytes"
        check_clean(driver, page)
        assert "<script>window.injected=1</script>" in driver.find_element(By.ID, "answer").text
        check_environment(driver, "raycl run")
        assert "normals are missing <script>" in driver.find_element(By.ID, "plots").get_attribute("textContent")
        for check in (check_growth, check_reasons, check_pointing, check_keyboard, check_controls):
            check(driver)
        check_clean(driver, page)
        page = Path(results) / "report.html"
        load(driver, page)
        check_environment(driver, "raycl run configs/quick.toml")
        for check in (check_gallery, check_pointing, check_keyboard, check_lightbox, check_controls):
            check(driver)
        check_clean(driver, page)
        if microscope:
            check_microscope(driver, Path(microscope))
    finally:
        driver.quit()
    printed(Path(results) / "report.html", "report")
    screenshots(Path(synthetic) / "report.html", "synthetic")
    screenshots(Path(results) / "report.html", "report")
    if reproduction:
        screenshots(Path(reproduction) / "reproduction.html", "reproduction")
    if microscope:
        screenshots(Path(microscope), "microscope")
    print("browser: all is well")


main(*sys.argv[1:])
