"""The book of the documents in a browser: its search answers twenty questions of first readers. Each third page loads
without an error and fits a phone, every page with EVERY_CASE=1. axe finds nothing serious in the light and the dark theme.

Usage: book.py FOLDER [CHROMIUM]
"""

import os
import sys
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, sync_playwright

BOOK = Path(sys.argv[1]).resolve()
BROWSER = sys.argv[2] if len(sys.argv) > 2 else None
PHONE = {"width": 390, "height": 844}
# Pages of each kind: prose, wide tables, commands, pictures.
JUDGED = ["docs/verdicts.html", "docs/tutorials/robot.html", "docs/kinematics.html"]
# What each reader wants to know, what the reader types, and the pages of which one must be among the first three results.
QUESTIONS = {
    "control engineer": [
        ("How do I begin a controller in C++?", "controller c++", ["your-controller", "interface", "install"]),
        ("How long may my controller compute?", "controller deadline", ["interface"]),
        ("What happens when it misses a cycle?", "missed command", ["interface", "realtime", "robot"]),
        ("How do I change a gain while the rig runs?", "change gain while running", ["live", "bring-up", "interface"]),
        ("Can Simulink control the rig?", "simulink", ["fmu"]),
    ],
    "test engineer": [
        ("What is exit code 5?", "exit code 5", ["verdicts"]),
        ("How do I require a smaller error than 0.5 mm?", "require error limit", ["requirements"]),
        ("How does my CI show the results?", "junit", ["suites", "ci"]),
        ("How do I break a cable during a run?", "inject fault", ["faults"]),
        ("May a failed test be repeated?", "flaky retry", ["suites", "ci"]),
    ],
    "dental researcher": [
        ("Which files of my tracker can be read?", "tracker file", ["motions", "patient"]),
        ("Where does a chewing cycle begin?", "chewing cycle", ["jaw-cycles"]),
        ("How do I compare before and after a treatment?", "compare patients", ["jaw-cycles", "patient"]),
        ("How hard does the food bite back?", "food bite force", ["dynamics-contact", "dynamics-control"]),
        ("Who can read my patients' data?", "patient privacy", ["run", "patient"]),
    ],
    "contributor": [
        ("How do I add a kind of fault?", "add kind of fault", ["CONTRIBUTING"]),
        ("What must pass before I push?", "ci steps", ["CONTRIBUTING"]),
        ("Where in the code does a cycle begin?", "cycle code", ["ARCHITECTURE"]),
        ("How do I renew the golden runs?", "renew golden", ["replay", "CONTRIBUTING"]),
        ("Which crate may depend on which?", "crate dependencies", ["ARCHITECTURE"]),
    ],
}


def search(page: Page) -> int:
    """How many questions have an answer among the first three results: all must."""
    page.goto((BOOK / "index.html").as_uri())
    missed, questions = [], [question for all_of in QUESTIONS.values() for question in all_of]
    for question, words, answers in questions:
        page.keyboard.press("/")
        page.locator("#mdbook-searchbar").press_sequentially(words)
        page.wait_for_function(f"document.querySelector('#mdbook-searchresults-header').textContent.includes('{words}')")
        found = page.eval_on_selector_all("#mdbook-searchresults li a", "links => links.map(link => link.getAttribute('href'))")
        if not any(Path(link.partition("?")[0]).stem in answers for link in found[:3]):
            missed.append((question, words, found[:5]))
        page.keyboard.press("Escape")
    assert not missed, "\n".join(map(str, missed))
    return len(questions)


def judge(page: Page, scheme: str, names: list[str]) -> None:
    page.emulate_media(color_scheme=scheme)
    for name in names:
        page.goto((BOOK / name).as_uri())
        # The button of the contents is mdbook's own: a label with the state of its check box.
        violations = Axe().run(page, context={"exclude": [["#mdbook-sidebar-toggle"]]}).response["violations"]
        serious = [(found["id"], found["nodes"][0]["html"]) for found in violations if found["impact"] in ("serious", "critical")]
        assert not serious, (scheme, name, serious)


def fit(page: Page) -> int:
    """On a phone a wide table scrolls by itself, and the page does not."""
    page.set_viewport_size(PHONE)
    pages = sorted(path for path in BOOK.rglob("*.html") if path.name not in ("404.html", "toc.html"))
    pages = pages[:: 1 if "EVERY_CASE" in os.environ else 3]
    for path in pages:
        page.goto(path.as_uri(), wait_until="domcontentloaded")
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= PHONE["width"], (path, width)
    return len(pages)


with sync_playwright() as playwright, playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"]) as browser:
    page = browser.new_page()
    errors: list[str] = []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    answered = search(page)
    count = fit(page)
    assert not errors, errors
    # axe reads the style sheets itself, which the browser refuses for files and reports as errors.
    judge(browser.new_page(), "light", JUDGED)
    judge(browser.new_page(), "dark", JUDGED[:1])
    print(f"book: {count} pages fit a phone without an error; the search answers {answered} questions; axe passed")
