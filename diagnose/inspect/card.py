"""One page about a data set: its content, origin, limits, and how to load it."""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from ...datasets.file.attributes import manifest_hash
from ...datasets.file.columns import Column, describe_columns
from ...datasets.file.record import DataSet
from ...datasets.generation.fidelity_choice import FidelityChoice
from ...sim.output.recording import DataError
from ...sim.scene.load import scene_table
from ...sim.scene.scene import SceneError
from ..feature_rows.feature_table import confounders_in
from ..learning.grades import GRADE_NAMES
from ..pages.page import render, save_page
from ..pages.picture import PageImage, page_image
from ..pages.words import quantity_name
from ..pictures.kinds import make_panel
from ..pictures.panel import panel_figure
from ..pictures.view import View

MOST_DRAWN = 3
"""Channels drawn in a picture."""

_FEW_TEXTS = 4  # different texts of a column that are listed


@dataclass(frozen=True, kw_only=True)
class CardTable:
    """Rows under a header; the columns listed in `numbers` are right-aligned."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Code:
    """A code snippet that runs in the folder of the file."""

    title: str
    text: str


@dataclass(frozen=True, kw_only=True)
class CardPicture:
    """A picture of one recording."""

    caption: str
    image: PageImage


Block = str | list[str] | CardTable | Code | CardPicture
"""A paragraph, a list, a table, a snippet or a picture."""


@dataclass(frozen=True, kw_only=True)
class Card:
    """A page.

    Attributes
    ----------
    title, lead : str
        Heading, and the page in one sentence.
    sections : tuple of (str, list of Block)
        Heading and content of each.
    """

    title: str
    lead: str
    sections: tuple[tuple[str, list[Block]], ...]


def write_card(
    path: str | Path, card: Path, *, licence: str = "not stated", force: bool = True
) -> None:
    """Write the page about a data set, completely or not at all.

    Parameters
    ----------
    path : str or Path
        A finished data set file.
    card : Path
        ``.md``: tables; ``.html``: also pictures of each class, in one file.
    licence : str
        Licence of the data, as stated by their owner.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        If the data set cannot be read, or the suffix is wrong.
    """
    if card.suffix not in (".md", ".html", ".htm"):
        raise DataError(f"{card}: suffix {card.suffix!r} must be .html or .md; rename it")
    text = card_markdown if card.suffix == ".md" else card_html
    with DataSet(path) as data:
        page = text(data_card(data, licence=licence, pictures=card.suffix != ".md"))
    save_page(page, card, force=force)


def data_card(data: DataSet, *, licence: str = "not stated", pictures: bool = True) -> Card:
    """Description of a data set, from the file alone.

    Parameters
    ----------
    data : DataSet
        Open data set.
    licence : str
        Licence of the data.
    pictures : bool
        Whether to draw one recording of every grade.

    Returns
    -------
    Card
        Page; all numbers are counted in the file, and signals are read only to be drawn.

    Raises
    ------
    DataError
        If the file is damaged.
    """
    facts = _Facts(data)
    sections: dict[str, list[Block]] = {
        "What it is": [_identity(facts)],
        "Labels": list(_labels(facts)),
        "One recording of each grade": list(_pictures(facts)) if pictures else [],
        "Columns": list(_columns(facts)),
        "Models and their errors": list(_models(facts)),
        "Splits": list(_splits(facts)),
        "Known limits": [_limits(facts)],
        "Licence and citation": [f"Licence: {licence}.", _citation(facts)],
        "How to load it": list(snippets(data.path.name, facts.primary)),
    }
    return Card(
        title=facts.title,
        lead=facts.lead,
        sections=tuple((name, blocks) for name, blocks in sections.items() if blocks),
    )


class _Facts:
    """Data used by several sections."""

    def __init__(self, data: DataSet) -> None:
        self.data = data
        self.head = data.attributes
        self.manifest = data.manifest
        self.ok = self.manifest["status"] == "ok"
        self.usable = self.manifest[self.ok]
        self.n_failed = len(self.manifest) - len(self.usable)
        self.simulated = self.head.origin == "simulated"
        self.n_machines = int(self.manifest["group"].nunique())

    @cached_property
    def recipe(self) -> dict[str, Any]:
        """Table of the recipe; empty without one."""
        try:
            return scene_table(self.head.recipe, "recipe") if self.head.recipe else {}
        except SceneError:
            return {}

    @property
    def primary(self) -> str:
        """Column to predict: the first severity, or else the grade."""
        return self.head.severities[0] if self.head.severities else "grade"

    @property
    def title(self) -> str:
        """Heading of the page."""
        return str(self.recipe.get("description") or self.data.path.stem)

    @property
    def lead(self) -> str:
        """The page in one sentence."""
        n_records, n_channels, n_samples = self.data.stored_shape
        machines = "machine draws" if self.simulated else "machines"
        return (
            f"{n_records} {self.head.origin} recordings of {self.n_machines} {machines}, "
            f"{n_samples / self.head.sample_rate:.4g} s of {n_channels} channels at "
            f"{self.head.sample_rate:g} Hz each."
        )


# --- sections -----------------------------------------------------------------------------------


def _identity(facts: _Facts) -> CardTable:
    head = facts.head
    n_records, n_channels, n_samples = facts.data.stored_shape
    hours = n_records * n_samples / head.sample_rate / 3600
    channels = ", ".join(channel.label for channel in head.channels)
    tacho = f" (tacho: {head.tacho}, {head.pulses_per_revolution} per revolution)"
    rows = [
        ("file", facts.data.path.name),
        ("origin", head.origin),
        ("records", f"{n_records}, of which {len(facts.usable)} are usable"),
        ("machines", str(facts.n_machines)),
        ("channels", channels + (tacho if head.tacho else "")),
        ("signal", f"{hours:.3g} h, {4e-6 * n_records * n_channels * n_samples:.4g} MB of float32"),
        ("made by", head.created_by),
    ]
    if facts.recipe:
        rows.append(("recipe", f"{facts.recipe.get('name')}, seed {head.seed}"))
    if head.limit_source:
        rows.append(("wear limits", head.limit_source))
    return CardTable(head=("", ""), rows=tuple(rows))


def _labels(facts: _Facts) -> Iterator[Block]:
    if facts.head.severities:
        yield CardTable(
            head=("severity", "column", "least [mm]", "median [mm]", "largest [mm]"),
            rows=tuple(_severity_row(facts, name) for name in facts.head.severities),
            numbers=("least [mm]", "median [mm]", "largest [mm]"),
        )
    yield _balance(facts)
    faults = confounders_in(facts.manifest)
    if faults:
        yield "Faults other than wear, each with its own label:"
        rows = [
            (name.replace("_", " "), f"confounder_{name}", *_count(present.sum(), len(present)))
            for name, present in faults.items()
        ]
        head = ("fault", "column", "records", "share")
        yield CardTable(head=head, rows=tuple(rows), numbers=head[2:])


def _severity_row(facts: _Facts, name: str) -> tuple[str, ...]:
    values = 1e3 * facts.manifest[name]
    return (
        quantity_name(name),
        name,
        *(f"{value:.4g}" for value in (values.min(), values.median(), values.max())),
    )


def _count(count: Any, total: int) -> tuple[str, str]:
    return str(int(count)), f"{100 * count / total:.1f} %"


def _balance(facts: _Facts) -> CardTable:
    """Number of records and machines of each grade."""
    grades = facts.manifest["grade"]
    rows = []
    for grade in sorted(grades.unique()):
        inside = facts.manifest[grades == grade]
        name = GRADE_NAMES[grade] if 0 <= grade < len(GRADE_NAMES) else "not known"
        machines = str(inside["group"].nunique())
        shown = str(grade) if grade >= 0 else "-"
        rows.append((shown, name, *_count(len(inside), len(grades)), machines))
    head = ("grade", "meaning", "records", "share", "machines")
    return CardTable(head=head, rows=tuple(rows), numbers=head[2:])


def _pictures(facts: _Facts) -> Iterator[Block]:
    """Waveform and spectrum of one usable record of each grade, of medium severity."""
    names = facts.data[0].vibration_names[:MOST_DRAWN]
    for grade in sorted(set(facts.usable["grade"].tolist())):
        records = facts.usable[facts.usable["grade"] == grade]
        order = records.sort_values(facts.primary, kind="stable").index
        index = int(order[len(order) // 2])
        view = View(recording=facts.data[index], channels=names)
        what = f"Grade {grade}, {GRADE_NAMES[grade]}" if grade >= 0 else "Grade not known"
        for kind in ("waveform", "spectrum"):
            try:
                panel = make_panel(view, kind)
            except DataError:
                continue  # too short for a spectrum
            caption = f"{what}, record {index} ({facts.head.origin}). {panel.caption}"
            yield CardPicture(caption=caption, image=page_image(panel_figure(panel)))


def _columns(facts: _Facts) -> Iterator[Block]:
    rows, empty = [], []
    for column in describe_columns([str(name) for name in facts.manifest]):
        values = facts.manifest[column.name]
        known = _known(values)
        if known.empty:
            empty.append(column.name)
        else:
            rows.append(_column_row(column, known, len(values)))
    head = ("column", "unit", "meaning", "least", "median", "largest", "unknown")
    yield CardTable(head=head, rows=tuple(rows), numbers=head[3:])
    if empty:
        yield f"Unknown in every record: {', '.join(empty)}."


def _known(values: pd.Series) -> pd.Series:
    """Known values: without NaN, empty texts and counts of -1."""
    known = values.notna()
    if values.dtype.kind == "i":
        known &= values >= 0
    if values.dtype.kind in "OUT":
        known &= values != ""
    return values[known]


def _column_row(column: Column, known: pd.Series, total: int) -> tuple[str, ...]:
    unknown = str(total - len(known)) if len(known) < total else ""
    head = (column.name, column.unit, column.meaning)
    if known.dtype.kind in "OUT":
        kinds = known.value_counts()
        few = len(kinds) <= _FEW_TEXTS
        shown = ", ".join(map(str, kinds.index)) if few else f"{len(kinds)} different"
        return (*head, shown, "", "", unknown)
    if known.dtype.kind == "b":
        return (*head, f"true in {int(known.sum())}", "", "", unknown)
    if column.role == "identity":
        return (*head, f"{known.nunique()} different", "", "", unknown)
    return (*head, *(f"{v:.4g}" for v in (known.min(), known.median(), known.max())), unknown)


def _models(facts: _Facts) -> Iterator[Block]:
    if not facts.simulated:
        return
    rows = []
    for column in describe_columns([str(name) for name in facts.manifest]):
        if column.name.startswith("rung_") or column.name == "contact_law":
            counts = Counter(_known(facts.usable[column.name]).tolist())
            if counts:
                shown = ", ".join(f"{name} ({count})" for name, count in counts.most_common())
                rows.append((column.meaning.rpartition(": ")[2], column.name, shown))
    if rows:
        yield CardTable(head=("effect", "column", "model (records)"), rows=tuple(rows))
    yield _choice_text(facts)
    yield _error_text(facts)
    status = Counter(facts.manifest["status"].tolist())
    shown = ", ".join(f"{count} {name}" for name, count in status.most_common())
    yield f"Status of the records: {shown}."


def _choice_text(facts: _Facts) -> str:
    if not facts.head.fidelity:
        return "Models and steps are those named in the scene; none was chosen by its error."
    chosen = FidelityChoice.load(facts.head.fidelity).text
    return f"Chosen on pilots, before the first record: {chosen}."


def _error_text(facts: _Facts) -> str:
    if "estimated_error" not in facts.usable:
        return "The numerical error is not estimated."
    errors = _known(facts.usable["estimated_error"])
    if errors.empty:
        return "The numerical error is not estimated."
    return (
        f"Estimated numerical error of the features: median {100 * errors.median():.2g} %, "
        f"largest {100 * errors.max():.2g} %, known for {len(errors)} records. It shows how well "
        "the equations are solved, not how well they fit a real machine."
    )


def _splits(facts: _Facts) -> Iterator[Block]:
    rows = []
    for name, about in facts.data.splits.items():
        train, test = facts.data.split(name)
        rest = len(facts.data) - len(train) - len(test)
        apart = "yes" if about.get("machines_apart", True) else "no, by design"
        text = str(about.get("text", about.get("kind", "")))
        rows.append((name, text, str(len(train)), str(len(test)), str(rest), apart))
    if rows:
        head = ("split", "description", "train", "test", "neither", "machines apart")
        yield CardTable(head=head, rows=tuple(rows), numbers=head[2:5])
    else:
        yield "The file has none. Split by the column group, which keeps machines together."


def _limits(facts: _Facts) -> list[str]:
    """Limits that a user must know, each counted in the file."""
    texts = []
    if facts.simulated:
        texts += [
            "Simulated: it contains only what the models contain. A method that works here need "
            "not work on a real machine.",
            "Grades are as frequent as in the recipe, not as in the field.",
        ]
    else:
        texts.append("Measured: labels are as given on import and were not checked.")
        unknown = int((facts.manifest["grade"] < 0).sum())
        if unknown:
            texts.append(f"The grade of {unknown} record(s) is not known.")
    if facts.n_machines < len(facts.manifest):
        texts.append(
            "Machines have several records: a split that is random by record puts the same "
            "machine on both sides. Split by the column group."
        )
    texts.append(
        "Only the signals are inputs. Labels and numerics reveal the severity, some exactly."
    )
    if facts.n_failed:
        texts.append(f"{facts.n_failed} record(s) have a status other than ok: leave them out.")
    if "clipped_samples" in facts.manifest:
        clipped = int((facts.manifest["clipped_samples"] > 0).sum())
        if clipped:
            texts.append(f"{clipped} record(s) hold saturated samples, as a real sensor would.")
    if facts.data.unhashed:
        texts.append(f"The file has no {' and no '.join(facts.data.unhashed)}.")
    return texts


def _citation(facts: _Facts) -> str:
    recipe = facts.recipe.get("name")
    source = f"recipe {recipe}, seed {facts.head.seed}, " if recipe else ""
    return (
        f"Cite as: {facts.title}. {facts.head.origin.capitalize()} data set, {source}"
        f"{facts.head.created_by}, manifest SHA-256 {manifest_hash(facts.data.rows)[:16]}."
    )


# --- how to load it -----------------------------------------------------------------------------


def snippets(file: str, label: str) -> tuple[Code, ...]:
    """Code that loads a data set, to be run in its folder.

    Parameters
    ----------
    file : str
        Name of the file.
    label : str
        Manifest column to predict.

    Returns
    -------
    tuple of Code
        Snippets for pandas, PyTorch, Hugging Face.

    Examples
    --------
    >>> [code.title for code in snippets("data.h5", "grade")]
    ['wearstate and pandas', 'PyTorch', 'Hugging Face']
    """
    values = {"file": json.dumps(file), "label": json.dumps(label)}
    return tuple(Code(title=title, text=text.format(**values)) for title, text in _SNIPPETS.items())


_SNIPPETS = {
    "wearstate and pandas": """\
from wearstate.datasets.file.record import DataSet

with DataSet({file}) as data:
    labels = data.manifest  # a pandas table, a row for every record
    usable = labels[labels["status"] == "ok"]
    signal = data[0].signal  # float32, channels x samples
""",
    "PyTorch": """\
import torch
from torch.utils.data import DataLoader, Subset
from wearstate.datasets.file.record import DataSet


def batch(items):
    signals = torch.from_numpy(np.stack([item.signal for item in items]))
    return signals, torch.tensor([item.row[{label}] for item in items])


data = DataSet({file})
usable = np.flatnonzero(data.manifest["status"] == "ok").tolist()
loader = DataLoader(
    Subset(data, usable), batch_size=4, shuffle=True, num_workers=2, collate_fn=batch
)
for signals, label in loader:
    break
""",
    "Hugging Face": """\
from datasets import load_dataset

data = load_dataset("hdf5", data_files={file}, split="train")
usable = data.filter(lambda row: row["status"] == b"ok", input_columns="manifest")
label = usable[0]["manifest"][{label}]
signal = usable.with_format("numpy")[0]["signal"]
""",
}


# --- pages --------------------------------------------------------------------------------------


def card_markdown(card: Card) -> str:
    """The page as Markdown, without pictures.

    Examples
    --------
    >>> card = Card(title="A", lead="One.", sections=(("B", ["Text.", ["x", "y"]]),))
    >>> print(card_markdown(card))
    # A
    <BLANKLINE>
    One.
    <BLANKLINE>
    ## B
    <BLANKLINE>
    Text.
    <BLANKLINE>
    - x
    - y
    <BLANKLINE>
    """
    parts = [f"# {card.title}", card.lead]
    for name, blocks in card.sections:
        parts += [f"## {name}", *(_markdown(block) for block in blocks)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _markdown(block: Block) -> str:
    if isinstance(block, str):
        return block
    if isinstance(block, list):
        return "\n".join(f"- {text}" for text in block)
    if isinstance(block, Code):
        return f"{block.title}:\n\n```python\n{block.text}```"
    return _markdown_table(block) if isinstance(block, CardTable) else ""


def _markdown_table(table: CardTable) -> str:
    rule = ["---:" if name in table.numbers else "---" for name in table.head]
    return "\n".join(_markdown_row(row) for row in (table.head, rule, *table.rows))


def _markdown_row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def card_html(card: Card) -> str:
    """The page as one self-contained file: no scripts, no links, embedded pictures.

    Parameters
    ----------
    card : Card
        Card from :func:`data_card`.

    Returns
    -------
    str
        HTML.
    """
    sections = [
        (
            name,
            [(_KINDS[type(block)], block) for block in blocks],
        )
        for name, blocks in card.sections
    ]
    return render("card.html.j2", card=card, sections=sections)


_KINDS = {str: "text", list: "list", CardTable: "table", Code: "code", CardPicture: "picture"}
"""Names of the blocks in the template."""
