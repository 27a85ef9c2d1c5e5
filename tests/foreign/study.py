"""The paper's claims and figures of a study with 80 samples: python tests/foreign/study.py STUDY

A figure has data and text, and all of it lies on the page: a coordinate that is no number, or a mark beside the page, fails. The
same tables give the same bytes.
"""
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

SCRIPTS = Path(__file__).parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
from study_claims import Share, cannot_be_predicted, faster, over_readings, reaches_the_closest, unique, wider, words  # noqa: E402

study = Path(sys.argv[1])
HOLDS, PARTLY, NOT = "holds", "holds in part", "does not hold"
share = lambda hits: Share(hits, 1000)

# A solver reaches the closest solution nearly always, more often than its rival, or neither.
assert [reaches_the_closest(share(one), share(300)) for one in (995, 700, 305)] == [HOLDS, PARTLY, NOT]
# Unpredictable: over the strokes and along jaw motions, over the strokes alone, or nowhere.
assert [cannot_be_predicted(share(close), share(jaw)) for close, jaw in ((980, 980), (980, 999), (999, 999))] == [HOLDS, PARTLY, NOT]
# A wider range is one that another sample would show as well: of any solution, of the true one alone, or of neither.
assert wider([share(900), share(600)], [share(100), share(200)]) == HOLDS
assert wider([share(605), share(600)], [share(300), share(200)]) == PARTLY
assert wider([share(605), share(600)], [share(205), share(200)]) == NOT
# A claim that holds under one reading alone holds in part, and the words name the reading and its caps.
under = lambda first, second: {("a", 10): first, ("b", 10): second}
assert [over_readings(under(*each)) for each in ((HOLDS, HOLDS), (HOLDS, NOT), (PARTLY, PARTLY), (NOT, NOT))] == [HOLDS, PARTLY, PARTLY, NOT]
assert words(under(HOLDS, NOT)) == "holds under: a (at most 10 iterations)" and words(under(NOT, NOT)) == "under no reading"
# One exception refutes uniqueness, and an empty sample shows nothing.
assert [unique(one) for one in (share(0), share(1), share(10), Share(0, 0))] == [HOLDS, PARTLY, NOT, NOT]
# Many more iterations are twice as many.
nan = float("nan")
rivals = ((14, 14), (13, 14), (7, 30), (7, 20))
assert [faster([7, median], [12, p90]) for median, p90 in rivals] + [faster([nan] * 2, [nan] * 2)] == [HOLDS, PARTLY, PARTLY, NOT, NOT]
# A small difference of small samples is not clear.
assert not Share(6, 10).clearly_exceeds(Share(5, 10)) and Share(6000, 10_000).clearly_exceeds(Share(5000, 10_000))
assert not Share(5, 10).clearly_exceeds(Share(5, 10)) and not Share(0, 0).clearly_exceeds(Share(0, 0))
# Nearly all does not read as all.
assert [str(one) for one in (Share(9999, 10_000), Share(10, 10), Share(1, 10_000))] == ["99.990 %", "100.0 %", "0.010 %"]


def made() -> dict:
    subprocess.run([sys.executable, SCRIPTS / "study.py", study], check=True, stdout=subprocess.PIPE)
    return {path.name: path.read_text() for path in study.iterdir() if path.suffix in (".svg", ".html")}


files = made()
assert made() == files, "the same tables give other bytes"
page = files.pop("study.html")
data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])
blocks = {block["id"]: block for section in data["sections"] for block in section["blocks"]}
claims = {row[1]: row[2]["mark"] for row in blocks["claims"]["data"]["rows"]}
assert len(claims) == 18 and set(claims.values()) <= {HOLDS, PARTLY, NOT} and not re.search(r"\bnan\b", str(blocks["claims"])), claims
assert all(row[5] == "" or row[5]["href"].removeprefix("#") in blocks for row in blocks["claims"]["data"]["rows"])
# Whatever this sample gives: these follow from the mechanism.
verdict = lambda part: next(verdict for claim, verdict in claims.items() if part in claim)
assert verdict("10⁻¹⁰ s on a Pentium") == NOT and verdict("whatever the initial guess") != HOLDS
assert verdict("the range of the human jaw") == HOLDS and verdict("Starting each step from the pose before") == HOLDS
assert verdict("A₁ has two positions") == HOLDS and verdict("several sets of leg angles") == HOLDS
assert "66.04°" in page, "the folded corner is the one of the paper"

shown = {name: block["data"] for name, block in blocks.items() if block["kind"] == "figure"}
assert len(shown) == 17 and shown == files, (sorted(shown), sorted(files))
for name, text in files.items():
    assert not re.search(r'"[^"]*\bnan\b', text), name
    svg = ElementTree.fromstring(text)
    width, height = (float(number) for number in svg.attrib["viewBox"].split()[2:])
    texts = [element for element in svg.iter() if element.tag.endswith("}text")]
    shapes = [element for element in svg.iter() if element.tag.endswith(("}path", "}use", "}image"))]
    assert width >= 500 and len(shapes) >= 15 and len(texts) >= 15, (name, width, len(shapes), len(texts))
    for use in (element for element in shapes if element.tag.endswith("}use")):
        assert 0 <= float(use.attrib["x"]) <= width and 0 <= float(use.attrib["y"]) <= height, (name, use.attrib)
# Teeth with their forces, angles of the solutions, and names of the solvers stand in the figures.
assert verdict("reproduces the pressure") == PARTLY
assert re.search(r">\d\d: \d+ MPa<", files["pressure.svg"]) and "true: " in files["fig8_solutions.svg"]
assert all(solver in files["success.svg"] for solver in ("published", "Newton–Raphson", "controller"))
assert all(way in files["readings.svg"] for way in ("reduced full steps", "bounded increments", "time steps", "Newton–Raphson"))
print(f"{len(claims)} claims are judged and {len(files)} figures drawn from the study's tables")
