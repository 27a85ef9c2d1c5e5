"""The documents as a book with search, without a network: scripts/book FOLDER

The contents are those of docs/README.md. The book has each document at its place in the repository, and each other file that a
document links: a picture as it is, a source as text. Every link of the built book must lead to a file of it and to its heading.
"""

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

CONTENTS = Path("docs/README.md")
PICTURES = {".png", ".svg"}
NAMED = re.compile(r"\[(?:\w|[-./])+\.md\]\(([^)#\s]+)")
LINK = re.compile(r'(?<=\]\()[^)#\s]+|(?<=src=")[^"]+')


def target(document: Path, link: str) -> Path:
    """The file that a link of a document leads to, from the project's folder."""
    return Path(os.path.normpath(document.parent / link))


def summary() -> str:
    """Each document once, where docs/README.md first links it as a whole; a label before a colon begins a part of its own."""
    lines = ["# Summary", "", "[Masseter](README.md)", "[All documents](docs/README.md)"]
    seen, part = {"README.md"}, ""
    for line in CONTENTS.read_text().splitlines():
        if line.startswith("## "):
            part = line[3:]
        if not line.startswith("- "):
            continue
        links = [(name, str(target(CONTENTS, link))) for name, link in re.findall(r"\[([^]]+)\]\(([^)#]+\.md)\)", line)]
        new = [(name, path) for name, path in dict.fromkeys(links) if path not in seen]
        seen.update(path for _, path in new)
        label = re.match(r"- ([^[:]+): \[", line)
        part = label[1] if label else part
        if new and f"# {part}" not in lines:
            lines += ["", f"# {part}", ""]
        lines += [f"- [{name[0].upper() + name[1:]}]({path})" for name, path in new]
    return "\n".join(lines) + "\n"


def gather(source: Path) -> None:
    """Writes the documents, and what they link, into the folder that mdbook reads."""
    contents = summary()
    documents = {Path(path) for path in re.findall(r"\((\S+\.md)\)", contents)}

    def placed(document: Path, link: str) -> str:
        file = target(document, link)
        if "://" in link or file in documents:
            return link
        # Browsers show text, and save what they do not know. mdbook would take every .md for a page.
        shown = link if file.suffix in PICTURES else link.removesuffix(".md") + ".txt"
        copy = source / target(document, shown)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, copy)
        return shown

    def titled(document: Path, link: re.Match[str]) -> str:
        """A document by its title, where a link has the name of its file."""
        file = target(document, link[1])
        return f"[{file.read_text().split(chr(10), 1)[0].strip('# ')}]({link[1]}" if file in documents else link[0]

    for document in sorted(documents):
        text = NAMED.sub(lambda link: titled(document, link), document.read_text())
        text = LINK.sub(lambda link: placed(document, link[0]), text)
        (source / document).parent.mkdir(parents=True, exist_ok=True)
        (source / document).write_text(text)
    (source / "SUMMARY.md").write_text(contents)


class Page(HTMLParser):
    """The names and the links of a page."""

    def __init__(self, path: Path):
        super().__init__()
        self.names: set[str] = set()
        self.links: list[str] = []
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for key, value in attributes:
            if key == "id" and value:
                self.names.add(value)
            elif key in ("href", "src") and value:
                self.links.append(unquote(value))


def dead_links(book: Path) -> tuple[int, list[str]]:
    """How many links the book has within itself, and those that lead nowhere."""
    pages = {path.resolve(): Page(path) for path in book.rglob("*.html") if path.name != "404.html"}
    count, dead = 0, []
    for path, page in pages.items():
        for link in page.links:
            if re.match(r"\w+:", link):
                continue
            count += 1
            file, _, name = link.partition("#")
            there = (path.parent / file).resolve() if file else path
            if not there.is_file() or (name and there in pages and name not in pages[there].names):
                dead.append(f"{path.relative_to(book.resolve())}: {link}")
    return count, dead


def main(folder: str) -> None:
    root = Path(folder)
    shutil.rmtree(root, ignore_errors=True)
    (root / "src").mkdir(parents=True)
    shutil.copyfile("docs/book.toml", root / "book.toml")
    # A link in a sentence is known by more than its colour.
    (root / "links.css").write_text(".content main a:link { text-decoration: underline }\n")
    gather(root / "src")
    subprocess.run([Path(sys.executable).with_name("mdbook"), "build", root], check=True, env=os.environ | {"MDBOOK_LOG": "warn"})
    for page in (root / "book").rglob("*.html"):
        # Keys scroll only what they can reach.
        text = page.read_text()
        for element in ("<pre><code", '<div class="table-wrapper"'):
            text = text.replace(element, element + ' tabindex="0"')
        page.write_text(text)
    count, dead = dead_links(root / "book")
    if dead:
        sys.exit("the book has links that lead nowhere:\n" + "\n".join(dead))
    print(f"book: {count} links lead to their pages; {root / 'book' / 'index.html'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
