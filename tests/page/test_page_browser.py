"""The HTML page in a real browser: headless Chromium, driven by selenium."""

import shutil
import time
from itertools import groupby

import pytest
from campaigns import make

from inscal.parameters import NAMES
from pipeline.config.load import load
from pipeline.page import compose as page

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
By = pytest.importorskip("selenium.webdriver.common.by").By

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(not (BROWSER and DRIVER), reason="no chromium and chromedriver")

PATIENCE_S = 30.0


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    paths = [str(make(folder / noise, f"noise={noise}")) for noise in ("quiet", "noisy")]
    file = folder / "page.html"
    file.write_text(page.html(page.campaigns(load([]), paths)))
    return file.as_uri()


@pytest.fixture(scope="module")
def browser():
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


def until(condition):
    end = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return found


def opened(browser, address, width=1280, scheme="light", unfold=True):
    """Open the page and wait until all that is unfolded is drawn."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    look = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", look)
    browser.get("about:blank")
    browser.get(address)
    if unfold:
        browser.execute_script("document.querySelectorAll('details').forEach((d) => d.open = true)")
        undrawn = "return document.querySelectorAll('[data-chart]:not(:has(svg))').length === 0"
        until(lambda: browser.execute_script(undrawn))
    until(lambda: browser.find_elements(By.CSS_SELECTOR, ".dt-search input"))
    return browser


def first_column(browser):
    cells = browser.find_elements(By.CSS_SELECTOR, "#parameters tbody th")
    return [cell.text for cell in cells]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_page_fits_and_every_section_is_shown(browser, address, width, scheme):
    opened(browser, address, width, scheme)
    log = browser.get_log("browser")
    assert log == []
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    for section in browser.find_elements(By.TAG_NAME, "section"):
        assert section.is_displayed()
        assert section.size["height"] > 40
    assert browser.execute_script("return performance.getEntriesByType('resource')") == []


def folded(browser):
    return browser.find_elements(By.CSS_SELECTOR, "details.section:not([open])")


def test_on_a_phone_it_is_short_and_the_verdicts_are_in_view(browser, address):
    opened(browser, address, 390, unfold=False)
    assert browser.execute_script("return document.documentElement.scrollHeight") < 10 * 844
    assert browser.find_elements(By.CSS_SELECTOR, ".chart svg") == []
    for cell in browser.find_elements(By.CSS_SELECTOR, "#parameters tbody th"):
        assert cell.rect["height"] < 40  # its name is on one line
    verdict = browser.find_element(By.CSS_SELECTOR, "tbody td").rect
    assert verdict["x"] + verdict["width"] <= 390
    for gist in browser.find_elements(By.CSS_SELECTOR, ".gist"):
        assert gist.text


def test_sections_unfold_by_link_and_all_at_once_each_chart_with_its_own_text(browser, address):
    opened(browser, address, unfold=False)
    count = len(folded(browser))
    browser.find_element(By.CSS_SELECTOR, "a[href='#nees']").click()
    until(lambda: len(folded(browser)) == count - 1)
    until(lambda: browser.find_elements(By.CSS_SELECTOR, "#nees svg"))
    browser.find_element(By.CSS_SELECTOR, "[data-unfold]").click()
    assert folded(browser) == []
    charts = browser.find_elements(By.CSS_SELECTOR, "[data-chart]")
    until(lambda: all(chart.get_attribute("aria-label") for chart in charts))
    texts = [chart.get_attribute("aria-label") for chart in charts]
    assert len({*texts}) == len(texts) > 27


def channels(color):
    return [float(part) for part in color[color.index("(") + 1 : -1].split(",")[:3]]


def contrast(a, b):
    """Contrast ratio of two colours, of WCAG 2."""

    def luminance(color):
        linear = [
            c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
            for c in (channel / 255.0 for channel in channels(color))
        ]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    light, dark = sorted((luminance(a), luminance(b)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_what_is_behind_it(browser, address, scheme):
    opened(browser, address, scheme=scheme)
    found = browser.execute_script("""
        const behind = (element) => {
          const color = getComputedStyle(element).backgroundColor;
          return color !== "rgba(0, 0, 0, 0)" ? color : behind(element.parentElement);
        };
        const some = "p, h1, h2, td, th, caption, figcaption, a, button, input, code, summary";
        const texts = [...document.querySelectorAll(some)].filter((e) => e.checkVisibility());
        const labels = [...document.querySelectorAll("svg text")];
        return [...texts.map((e) => [getComputedStyle(e).color, behind(e)]),
                ...labels.map((e) => [getComputedStyle(e).fill, behind(e)])];
    """)
    assert len(found) > 500
    assert min(contrast(*pair) for pair in {tuple(pair) for pair in found}) >= 4.5


def test_print_is_light(browser, address):
    opened(browser, address, scheme="dark")
    dark = "return getComputedStyle(document.body).backgroundColor"
    assert channels(browser.execute_script(dark)) < [60.0] * 3
    look = {"media": "print", "features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", look)
    assert channels(browser.execute_script(dark)) == [255.0] * 3
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_every_column_sorts(browser, address):
    opened(browser, address)
    assert first_column(browser) == list(NAMES)
    for number, heading in enumerate(
        browser.find_elements(By.CSS_SELECTOR, "#parameters th[scope=col]")
    ):
        heading.click()
        until(lambda heading=heading: heading.get_attribute("aria-sort") == "ascending")
        cells = browser.find_elements(
            By.CSS_SELECTOR, f"#parameters tbody tr > :nth-child({number + 1})"
        )
        shown = [cell.get_attribute("data-order") or cell.text for cell in cells]
        if cells[0].get_attribute("data-order"):
            keys = [*map(float, shown)]
            assert keys == sorted(keys)
        else:  # in the order of the browser's language: what is the same is together
            assert len([*groupby(shown)]) == len({*shown})


def test_filter_leaves_the_rows_that_match(browser, address):
    opened(browser, address)
    field = browser.find_element(By.CSS_SELECTOR, ".dt-search input")
    field.send_keys("lever")
    until(lambda: len(first_column(browser)) == 3)
    assert first_column(browser) == [name for name in NAMES if "lever" in name]


def test_parameter_opens_its_panel_by_click_and_by_key(browser, address):
    opened(browser, address)
    dialog = browser.find_element(By.ID, "panel")
    assert not dialog.is_displayed()
    browser.find_element(By.CSS_SELECTOR, "[data-parameter=accel_k13]").click()
    until(lambda: len(dialog.find_elements(By.TAG_NAME, "svg")) >= 3)
    assert "accel_k13" in dialog.find_element(By.TAG_NAME, "h2").text
    for figure in dialog.find_elements(By.TAG_NAME, "figure"):
        assert figure.find_element(By.TAG_NAME, "svg").is_displayed()
        assert figure.find_element(By.TAG_NAME, "figcaption").text.endswith(".")
    dialog.find_element(By.CSS_SELECTOR, "[data-step='1']").click()
    following = NAMES[NAMES.index("accel_k13") + 1]
    until(lambda: following in dialog.find_element(By.TAG_NAME, "h2").text)
    dialog.find_element(By.CSS_SELECTOR, "[data-close]").send_keys("\ue00c")  # Escape
    until(lambda: not dialog.is_displayed())
    browser.find_element(By.CSS_SELECTOR, "[data-parameter=gyro_bias_x]").send_keys(
        "\ue007"
    )  # Enter
    until(dialog.is_displayed)
    assert browser.get_log("browser") == []
