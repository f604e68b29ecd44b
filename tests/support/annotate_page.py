"""The annotation page as the tests use it: what a person does on it, in a real browser."""

import json
import math

from support.browser import until


class Page:
    """What a person does on the page, with mouse and keys."""

    def __init__(self, driver, url):
        self.driver = driver
        driver.get(url)
        self.ready()

    def ready(self):
        until("the page", lambda: self.one("body").get_attribute("data-ready") == "true")

    def one(self, selector):
        return self.driver.find_element("css selector", selector)

    def all(self, selector):
        return self.driver.find_elements("css selector", selector)

    def text(self, selector):
        return self.one(selector).get_property("textContent")

    def click(self, selector):
        until(selector, lambda: self.one(selector).click() is None)

    def press(self, keys):
        until("what has the focus", lambda: self.driver.switch_to.active_element.send_keys(keys) is None)

    def saved(self):
        until("saved", lambda: self.text("#saved") == "saved")

    def leave(self):
        """Out of any field, nothing selected."""
        self.press("\ue00c")
        self.press("\ue00c")

    def write(self, field, words):
        element = self.one(f"#field-{field}")
        element.send_keys("\ue009" + "a" + "\ue000", words)

    def click_at(self, point, bounds):
        """Click a point of the scene, seen from above."""
        from selenium.webdriver import ActionChains

        self.press("t")
        canvas = self.one("#view canvas")
        width, height = canvas.size["width"], canvas.size["height"]
        (x0, y0, _), (x1, y1, top) = bounds
        half = max(y1 - y0, (x1 - x0) / (width / height)) / 2
        away = top + 1.05 * half / math.tan(math.pi / 6) - point[2]
        scale = height / 2 / (away * math.tan(math.pi / 6))
        dx, dy = (point[0] - (x0 + x1) / 2) * scale, ((y0 + y1) / 2 - point[1]) * scale
        ActionChains(self.driver).move_to_element_with_offset(canvas, round(dx), round(dy)).click().perform()


def entries(annotations, kind="objects"):
    return json.loads(annotations.read_text())[kind]
