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
from pendmap.formatting import Estimate, estimate_text, interval
from pendmap.model.labels import unit_of
from pendmap.render import drawing, style
from pendmap.render.report import figures
from pendmap.report.markdown import as_page, markdown_templates, plain

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run
    from pendmap.diagnosis import Discrepancy

VOID = {"meta", "img", "br"}


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

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record an opened tag, and images."""
        self.tags.add(tag)
        if tag == "img":
            self.images.append(str(dict(attrs)["src"]))
        if tag not in VOID:
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
        return once("none")
    if verdict == "unknown":
        return once("base_sway", seed=1, max_effects=0)
    if verdict == "ambiguous":
        return once("quadratic_drag", size=0.1)
    named = once("quadratic_drag")
    if verdict == "named":
        return named
    # Only the text of the report depends on them.
    assessment = dataclasses.replace(named.assessment, verdict="partial", left=12.0)
    nearly = tuple(dataclasses.replace(effect, approximate=True) for effect in named.effects)
    return dataclasses.replace(named, assessment=assessment, effects=nearly)


@pytest.mark.parametrize("verdict", ["none", "named", "partial", "ambiguous", "unknown"])
def test_each_verdict_has_a_report(verdict: str, tmp_path: Path) -> None:
    found = of_verdict(verdict)
    assert found.verdict == verdict
    folder = render.write_report(found, tmp_path / "report")
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    markdown = (folder / "report.md").read_text(encoding="utf-8")
    assert f"**{verdict.capitalize()}**" in markdown
    pictures = re.findall(r"\]\(<(.*?)>\)", markdown)
    assert {"gap.png", "residuals.png", "torque.png", "ranking.png"} <= set(pictures)
    for name, image in zip(pictures, page.images, strict=True):
        kind, content = image.split(",")
        assert kind == "data:image/png;base64"
        assert (folder / name).read_bytes() == base64.b64decode(content)
    # One file without external references or scripts.
    assert not page.tags & {"script", "link", "iframe"}
    claims = verdict in {"named", "partial", "ambiguous"}
    assert ("after" in page.words) == claims
    assert ("baseline" in page.words) or claims
    assert ("`-q v |v|`" in markdown) == claims
    # What the command prints is in the report.
    first, *lines = [line.strip() for line in as_text(found)]
    meaning = first.removeprefix(f"Verdict: {verdict}: ")
    assert f"**{verdict.capitalize()}**: {meaning}." in markdown
    assert all(f"- {plain(line)}\n" in markdown for line in lines)
    if verdict == "ambiguous":
        (names,) = found.equivalent
        assert f"- indistinguishable in these records: {', '.join(names)}\n" in markdown
        assert "To distinguish equally good names, record what reveals" in markdown


def test_a_report_states_the_thresholds_of_its_diagnosis() -> None:
    found = once("quadratic_drag", size=0.1)
    limits = Thresholds(rest=0.02, alike=12.5)
    assessment = dataclasses.replace(found.assessment, thresholds=limits)
    found = dataclasses.replace(found, assessment=assessment)
    text = report.as_markdown(found, {})
    assert "Below 0.02 the residuals are significant." in text
    assert "indistinguishable: behind by less than 12.5, or by one run alone" in text


def test_the_numbers_of_a_report_are_those_of_the_json() -> None:
    found = once("quadratic_drag")
    fields = as_json(found)
    text = report.as_markdown(found, {})
    lines = [line for line in text.split("\n") if line.startswith("|")]
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    told: dict[object, list[str]] = {(row[0], row[1]): row for row in rows}
    told |= {row[0]: row for row in rows}
    gap = fields["gap"]
    floor = gap["noise_floor"]
    assert told["residual (mrad)"] == ["residual (mrad)", "before", "after", "noise"]
    assert told["fitted runs"][1:] == [mrad(gap["before"]), mrad(gap["after"]), mrad(floor)]
    held = [mrad(gap[f"held_out_{what}"]) for what in ("before", "after", "noise_floor")]
    assert told["held out"][1:] == held
    for run in gap["runs"]:
        name = f"{'held out: ' if run['held_out'] else ''}`{run['name']}`"
        numbers = [mrad(run[key]) for key in ("before", "after", "noise_floor")]
        assert [name, *numbers] in rows
    for forecast in fields["forecast"]:
        ahead = f"{forecast['horizon_s'][-1]:.3g}"
        last = [mrad(forecast[key][-1]) for key in ("before", "after")]
        assert told[forecast["runs"], ahead][2:4] == last
    (effect,) = fields["effects"]
    assert f"probability {effect['probability']:.3f}" in text
    for name, value in found.parameters.items():
        assert told[f"`{name}`", unit_of(name)][3:] == [estimate_text(value), interval(value)]
    assert found.parameters["quadratic_drag.q"].value == effect["parameters"]["q"]
    for row in fields["ranking"][:8]:
        assert told[f"`{row['name']}`"][0] == f"`{row['name']}`"
        assert any(r[0] == f"`{row['name']}`" and f"{row['score']:.1f}" in r for r in rows)
    for name, limit in fields["detection_limits"].items():
        size = found.definition(name).parameters[0].name
        assert told[f"`{name}.{size}`"][1].split()[0] == f"{limit:.2g}"
    for run, each in zip(found.data.fitted, fields["runs"]["quadratic_drag.q"], strict=True):
        value = estimate_text(Estimate(each["value"], each["stderr"]))
        assert ["`quadratic_drag.q`", f"`{run.name}`", value] in rows


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


def mrad(value: float) -> str:
    return f"{1e3 * value:.3g}"


NASTY = "a|b <script>alert(1)</script> *c* _d_ `e` [f](g) # & \\ $h$ ``i"


def test_text_of_a_user_is_shown_unchanged() -> None:
    """HTML and Markdown of what a template prints contain the given text."""
    template = """# Title {{ text }}

**Strong** and {{ text }}

## {{ text }}

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
    given = [f"Title {NASTY}", f"Strong and {NASTY}", NASTY, f"1. {NASTY}", f"- {NASTY}", NASTY]
    given += [f"{NASTY} and ` + more", "one two|three", NASTY, NASTY, "-4.5"]
    page = as_page(text)
    assert f"<title>{html.escape(f'Title {NASTY}')}</title>" in page
    assert "script" not in Page(page).tags
    assert Page(page).words == " ".join(given).split()
    read = MarkdownIt("commonmark").enable("table").render(text)
    assert Page(read).words == Page(page).words


def test_a_name_in_a_report_is_shown_unchanged() -> None:
    found = once("quadratic_drag")
    runs = [dataclasses.replace(run, name=NASTY, file=NASTY) for run in found.data.runs]
    fitted = [dataclasses.replace(run, name=NASTY) for run in found.data.fitted]
    gap = [dataclasses.replace(run, name=NASTY) for run in found.gap.by_run]
    renamed = dataclasses.replace(
        found,
        data=dataclasses.replace(found.data, runs=tuple(runs), fitted=tuple(fitted)),
        gap=dataclasses.replace(found.gap, by_run=gap),
    )
    page = Page(report.as_html(renamed, {}))
    assert "script" not in page.tags
    assert " ".join(page.words).count(NASTY) >= len(runs) + len(fitted) + len(gap)


def test_a_report_is_written_in_each_format(tmp_path: Path) -> None:
    found = once("quadratic_drag")
    assert render.write_report(found, tmp_path / "a.html") == tmp_path / "a.html"
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]
    render.write_report(found, tmp_path / "b.md")
    text = (tmp_path / "b.md").read_text(encoding="utf-8")
    for name in re.findall(r"\]\(<(.*?)>\)", text):
        assert name.startswith("b_")
        assert (tmp_path / name).exists()
    with pytest.raises(InputError, match=r"suffix must be \.html or \.md, .*, got '\.pdf'"):
        render.write_report(found, tmp_path / "c.pdf")


@pytest.mark.parametrize("name", ["new", "there", "a.md", "a.html"])
def test_a_report_that_exceeds_the_disk_leaves_no_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Python does not notice that a file of bytecode was cut, and later reads what is left.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    found = once("quadratic_drag")
    (tmp_path / "there").mkdir()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))  # enough for most figures
    try:
        with pytest.raises(OSError, match="File too large"):
            render.write_report(found, tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


@pytest.mark.parametrize("report", ["a.pdf", "absent/report", "file"])
def test_invalid_paths_are_refused_at_once(
    report: str, tmp_path: Path, pendmap_command: Run
) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "hidden").mkdir()
    run = pendmap_command("diagnose", "hidden", "--report", report)
    assert run.returncode == 2
    assert "--report" in run.stderr
    assert report in run.stderr
    assert len(run.stderr.strip().splitlines()) == 1


@pytest.mark.thorough
def test_an_experiment_of_one_decay_has_a_report(tmp_path: Path, pendmap_command: Run) -> None:
    """Stretches are held out within the run; there is no phase of a drive and no comparison."""
    made = pendmap_command("rig", "free_decay", "--out", "decay")
    assert made.returncode == 0, made.stderr
    run = pendmap_command("diagnose", "decay", "--report", "report.md", "--quiet")
    assert run.returncode == 0, run.stderr
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "Held out: stretches of `run_00`" in text
    assert "runs.png" not in text
    assert "| forced |" not in text


def test_figures_of_a_report_fit_their_pages() -> None:
    found = once("quadratic_drag")
    with rc_context(style.RC):
        drawn = [*figures(found).values(), drawing.draw(diagnosis.sheet(found), dpi=60.0)]
        for figure in drawn:
            figure.canvas.draw()
            drawn_in = figure.get_tightbbox()
            width, height = figure.get_size_inches()
            assert drawn_in.x0 > 0
            assert drawn_in.y0 > 0
            assert drawn_in.x1 < width
            assert drawn_in.y1 < height
