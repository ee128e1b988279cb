"""Reports of diagnoses, one for each verdict: numbers equal to the JSON, well-formed pages."""

from __future__ import annotations

import base64
import dataclasses
import html
import math
import re
import resource
import sys
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest
from markdown_it import MarkdownIt
from matplotlib import rc_context

from hidden import once
from pendmap import InputError, render, report
from pendmap.charts import diagnosis
from pendmap.diagnosis import Thresholds
from pendmap.diagnosis.result import as_text
from pendmap.diagnosis.summary import as_json
from pendmap.diagnosis.table import NOTE
from pendmap.formatting import Estimate, estimate_text, interval
from pendmap.model.labels import unit_of
from pendmap.render import drawing, style
from pendmap.report.markdown import as_page, markdown_templates, plain

if TYPE_CHECKING:
    from pathlib import Path

    from pendmap.diagnosis import Discrepancy

NASTY = "a|b <script>alert(1)</script> *c* _d_ `e` [f](g) # & \\ $h$ ``i"


class Page(HTMLParser):
    """Text and images of a page, with a check that every opened tag is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.images: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)
        self.close()
        assert self.open == []
        # One file without external references or scripts.
        assert not self.tags & {"script", "link", "iframe"}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record an opened tag, and images."""
        self.tags.add(tag)
        if tag == "img":
            self.images.append(str(dict(attrs)["src"]))
        if tag not in {"meta", "img", "br"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Assert that the closed tag is the last one opened."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Collect the text."""
        if self.open and self.open[-1] not in {"style", "title", "figcaption"}:
            self.words += data.split()


def of_verdict(verdict: str) -> Discrepancy:
    if verdict == "none":
        return once("none", seed=5, free=1, forced=0)
    if verdict == "unknown":
        return once("base_sway", seed=1, max_effects=0)
    if verdict == "ambiguous":
        alike = once("quadratic_drag", size=0.1)
        limits = Thresholds(rest=0.02, alike=12.5)
        assessment = dataclasses.replace(alike.assessment, thresholds=limits)
        return dataclasses.replace(alike, assessment=assessment)
    named = once("quadratic_drag")
    if verdict == "named":
        return named
    # Only the text of the report depends on what follows.
    fitted = tuple(dataclasses.replace(run, name=NASTY) for run in named.data.fitted)
    gap = [dataclasses.replace(run, name=NASTY) for run in named.gap.by_run]
    assessment = dataclasses.replace(named.assessment, verdict="partial", left=12.0)
    nearly = tuple(dataclasses.replace(effect, approximate=True) for effect in named.effects)
    return dataclasses.replace(
        named,
        assessment=assessment,
        effects=nearly,
        data=dataclasses.replace(named.data, fitted=fitted),
        gap=dataclasses.replace(named.gap, by_run=gap),
    )


@pytest.mark.parametrize("verdict", ["none", "named", "partial", "ambiguous", "unknown"])
def test_each_verdict_has_a_report_of_what_is_printed(verdict: str) -> None:
    found = of_verdict(verdict)
    assert found.verdict == verdict
    markdown, page = report.as_markdown(found, {}), Page(report.as_html(found, {}))
    claims = verdict in {"named", "partial", "ambiguous"}
    assert ("after" in page.words) == claims
    assert ("baseline" in page.words) or claims
    assert ("`-q v |v|`" in markdown) == claims
    first, *lines = [line.strip() for line in as_text(found)]
    meaning = first.removeprefix(f"Verdict: {verdict}: ")
    assert f"**{verdict.capitalize()}**: {meaning}." in markdown
    assert lines.pop() == NOTE
    assert all(f"- {plain(line)}\n" in markdown for line in lines)
    if verdict == "none":
        # Stretches are held out within one decay; there is no phase of a drive and no comparison.
        assert "Held out: stretches of `run_00`" in markdown
        assert "| forced |" not in markdown
    if verdict == "partial":
        assert " ".join(page.words).count(NASTY) >= len(found.data.fitted) + len(found.gap.by_run)
    if verdict == "ambiguous":
        assert "Below 0.02 the residuals are significant." in markdown
        assert "Indistinguishable: behind by less than 12.5, or by one run alone" in markdown
        (names,) = found.equivalent
        assert f"- indistinguishable in these records: {', '.join(names)}\n" in markdown
        assert "To distinguish equally good names, record what reveals" in markdown


def test_the_numbers_of_a_report_are_those_of_the_json() -> None:
    found = once("quadratic_drag")
    fields = as_json(found)
    text = report.as_markdown(found, {})
    lines = [line for line in text.split("\n") if line.startswith("|")]
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    by_name: dict[object, list[str]] = {(row[0], row[1]): row for row in rows}
    by_name |= {row[0]: row for row in rows}
    gap = fields["gap"]
    assert by_name["residual (mrad)"] == ["residual (mrad)", "before", "after", "noise"]
    fitted = [mrad(gap[key]) for key in ("before", "after", "noise_floor")]
    assert by_name["fitted runs"][1:] == fitted
    held = [mrad(gap[f"held_out_{what}"]) for what in ("before", "after", "noise_floor")]
    assert by_name["held out"][1:] == held
    for run in gap["runs"]:
        name = f"{'held out: ' if run['held_out'] else ''}`{run['name']}`"
        numbers = [mrad(run[key]) for key in ("before", "after", "noise_floor")]
        assert [name, *numbers] in rows
    for forecast in fields["forecast"]:
        ahead = f"{forecast['horizon_s'][-1]:.3g}"
        last = [mrad(forecast[key][-1]) for key in ("before", "after")]
        assert by_name[forecast["runs"], ahead][2:4] == last
    (effect,) = fields["effects"]
    (row,) = (r for r in rows if r[0] == f"`{effect['name']}`" and len(r) == 6)
    ends = row[4].removeprefix("[").removesuffix("] 1/rad").split(", ")
    assert [float(end) for end in ends] == pytest.approx(effect["ci95"]["q"], rel=0.01)
    assert row[2] == f"{100 * effect['closes']:.0f} %"
    assert row[5] == f"{effect['probability']:.2f}"
    for name, value in found.parameters.items():
        assert by_name[f"`{name}`", unit_of(name)][3:] == [estimate_text(value), interval(value)]
    assert found.parameters["quadratic_drag.q"].value == effect["parameters"]["q"]
    order = [row["name"] for row in fields["ranking"]]
    assert {r[0].strip("`") for r in rows if len(r) == 6} - {"effect", "---"} <= set(order)
    for name, limit in fields["detection_limits"].items():
        size = found.definition(name).parameters[0].name
        assert by_name[f"`{name}.{size}`"][1].split()[0] == f"{limit:.2g}"
    for run, one in zip(found.data.fitted, fields["runs"]["quadratic_drag.q"], strict=True):
        value = estimate_text(Estimate(one["value"], one["stderr"]))
        assert ["`quadratic_drag.q`", f"`{run.name}`", value] in rows


def mrad(value: float) -> str:
    return f"{1e3 * value:.3g}"


@pytest.mark.parametrize("size", [1.0, -1.0])
def test_the_band_of_all_runs_is_the_interval_that_is_stated(size: float) -> None:
    found = once("quadratic_drag")
    (effect,) = found.effects
    low, high = effect.ci95["q"]
    if size < 0:
        # A negative size is stated as a positive one.
        parameters = {"q": -effect.parameters["q"]}
        turned = dataclasses.replace(effect, parameters=parameters, ci95={"q": (-high, -low)})
        found = dataclasses.replace(found, effects=(turned,))
    with rc_context(style.RC):
        made = drawing.draw(diagnosis.parts(found)["runs"], dpi=60.0)
    (band,) = made.axes[0].patches
    ends = band.get_window_extent().transformed(made.axes[0].transData.inverted())
    power = 3 * math.floor(math.log10(effect.parameters["q"] * size * size) / 3)
    assert (ends.y0, ends.y1) == pytest.approx((low / 10**power, high / 10**power), rel=1e-6)


def test_text_of_a_user_is_shown_unchanged() -> None:
    template = """# Title {{ text }}

**Strong** and {{ text }}

{{ "1. " ~ text }}

{{ "- " ~ text }}

- {{ text }}
- {{ text|code }} and {{ "`"|code }}
- {{ more }}

{{ ["one", none, "two|three"]|head }}
{{ [text|code, none, text]|row }}
{{ ["", none, -4.5]|row }}
"""
    text = markdown_templates().from_string(template).render(text=NASTY, more="+ more")
    given = [f"Title {NASTY}", f"Strong and {NASTY}", f"1. {NASTY}", f"- {NASTY}", NASTY]
    given += [f"{NASTY} and ` + more", "one two|three", NASTY, NASTY, "-4.5"]
    page = as_page(text)
    assert f"<title>{html.escape(f'Title {NASTY}')}</title>" in page
    assert Page(page).words == " ".join(given).split()
    read = MarkdownIt("commonmark").enable("table").render(text)
    assert Page(read).words == Page(page).words


def test_a_report_is_written_in_each_format(tmp_path: Path) -> None:
    found = once("quadratic_drag")
    assert render.write_report(found, tmp_path / "a.html") == tmp_path / "a.html"
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]
    render.write_report(found, tmp_path / "b.md")
    page = Page((tmp_path / "a.html").read_text(encoding="utf-8"))
    pictures = re.findall(r"\]\(<(.*?)>\)", (tmp_path / "b.md").read_text(encoding="utf-8"))
    assert {"b_gap.png", "b_residuals.png", "b_torque.png", "b_ranking.png"} <= set(pictures)
    for name, image in zip(pictures, page.images, strict=True):
        kind, content = image.split(",")
        assert kind == "data:image/png;base64"
        assert (tmp_path / name).read_bytes() == base64.b64decode(content)
    with pytest.raises(InputError, match=r"suffix must be \.html or \.md, got '\.pdf'"):
        render.write_report(found, tmp_path / "c.pdf")


def test_a_report_that_exceeds_the_disk_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Python does not notice that a file of bytecode was cut, and later reads what is left.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))  # enough for most figures
    try:
        with pytest.raises(OSError, match="File too large"):
            render.write_report(once("quadratic_drag"), tmp_path / "a.md")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
