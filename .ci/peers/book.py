"""Writes the Python pages of the book: executed notebooks, and an index of the package's reference.

book.py DOCS runs each notebook of python/notebooks, writes it as Markdown with its outputs and figures into
DOCS/notebooks, and lists the pages in DOCS/SUMMARY.md below the chapter on Python. An exception in a cell fails it.
"""

import re
import sys
from pathlib import Path

import nbformat
from nbconvert import MarkdownExporter
from nbconvert.preprocessors import ExecutePreprocessor

ROOT = Path(__file__).resolve().parent.parent.parent
# Rules for tables, whose blank lines would end the HTML block in Markdown.
STYLE = re.compile(r"<style scoped>.*?</style>\n", re.DOTALL)
CHAPTER = "- [Python](python.md)\n"


def rendered(path, folder):
    """Runs a notebook and writes its page; returns its title."""
    notebook = nbformat.read(path, 4)
    ExecutePreprocessor(timeout=900).preprocess(notebook, {"metadata": {"path": str(path.parent)}})
    for cell in notebook.cells:
        if "outputs" in cell:
            # Progress of commands goes to standard error.
            cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
    resources = {"output_files_dir": f"{path.stem}_files", "unique_key": path.stem}
    body, resources = MarkdownExporter().from_notebook_node(notebook, resources)
    for name, data in resources["outputs"].items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    (folder / f"{path.stem}.md").write_text(STYLE.sub("", body), encoding="utf8")
    return re.search(r"^# (.*)", body, re.MULTILINE)[1]


def main():
    docs = Path(sys.argv[1])
    folder = docs / "notebooks"
    folder.mkdir()
    pages, links = [], {}
    for path in sorted((ROOT / "python/notebooks").glob("*.ipynb")):
        page = f"notebooks/{path.stem}.md"
        pages.append(f"  - [{rendered(path, folder)}]({page})\n")
        links[f"../python/notebooks/{path.name}"] = page

    modules = sorted(docs.glob("api/foxhunt*.html")) + sorted(docs.glob("api/foxhunt/*.html"))
    names = [".".join(module.relative_to(docs / "api").with_suffix("").parts) for module in modules]
    rows = "".join(f"- [`{name}`](api/{name.replace('.', '/')}.html)\n" for name in names)
    intro = "# Reference of the Python package\n\nClasses and functions with their types, one page a module:\n\n"
    (docs / "python-reference.md").write_text(intro + rows, encoding="utf8")
    pages.append("  - [Reference of the package](python-reference.md)\n")

    summary = (docs / "SUMMARY.md").read_text(encoding="utf8")
    if CHAPTER not in summary:
        sys.exit(f"docs/SUMMARY.md lacks the chapter {CHAPTER}")
    (docs / "SUMMARY.md").write_text(summary.replace(CHAPTER, CHAPTER + "".join(pages)), encoding="utf8")
    # On the site, links to a notebook lead to its page.
    for page in docs.glob("*.md"):
        text = page.read_text(encoding="utf8")
        for notebook, target in links.items():
            text = text.replace(f"({notebook})", f"({target})")
        page.write_text(text, encoding="utf8")


main()
