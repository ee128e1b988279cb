"""Model files: round trips, keys, errors that are reported on one line."""

from __future__ import annotations

import datetime as dt
import math
import tomllib
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pendmap
from models import EXAMPLE, written
from pendmap import Effect, InputError, Pendulum, Rig, load_model, save_model

if TYPE_CHECKING:
    from pathlib import Path


def test_a_file_in_si_with_every_key_is_read(tmp_path: Path) -> None:
    rig = load_model(written(tmp_path, EXAMPLE))
    assert isinstance(rig, Rig)
    assert (rig.w0, rig.c_over_m, rig.Tr, rig.phi, rig.lab_time_s) == (6.2, 0.05, 0.08, 0.3, 150)
    assert rig.Omega == pytest.approx(2 * math.pi * 1.9, rel=1e-15)
    assert rig.p == pytest.approx(0.02 * rig.Omega**2 / 9.81, rel=1e-15)
    drag, harmonic = rig.effects
    assert drag == Effect("quadratic_drag", {"q": 0.012}, {"q": (0.011, 0.013)}, 0.97, False)  # noqa: FBT003
    assert harmonic.values == [0.6, 4.0, 0.1]
    assert harmonic.ci95 == {}
    assert pendmap.load_model(tmp_path / "model.toml") == rig


def test_notes_of_a_fit_are_written_unchanged(tmp_path: Path) -> None:
    rig = load_model(written(tmp_path, EXAMPLE))
    path = save_model(rig, tmp_path / "again.toml")
    assert load_model(path) == rig
    before, after = (tomllib.loads(text) for text in (EXAMPLE, path.read_text(encoding="utf-8")))
    for table in ("covariance", "provenance"):
        assert after[table] == before[table]
    assert after["provenance"]["made"] == dt.datetime(2024, 5, 1, 12, tzinfo=dt.UTC)
    assert after["effect"][0] == before["effect"][0]
    assert after["format_version"] == 1
    # Writing it again gives identical bytes.
    assert save_model(load_model(path), tmp_path / "third.toml").read_bytes() == path.read_bytes()


finite = st.floats(allow_nan=False, allow_infinity=False)
small = st.floats(-1e6, 1e6)
notes = st.dictionaries(
    st.sampled_from(["covariance", "provenance"]),
    st.dictionaries(st.text(st.characters(codec="utf-8")), finite | st.text() | st.booleans()),
)


@st.composite
def effects(draw: st.DrawFn) -> tuple[Effect, ...]:
    q, width = draw(small), draw(st.floats(0, 10))
    drag = Effect(
        "quadratic_drag",
        {"q": q},
        ci95=draw(st.sampled_from([{}, {"q": (q - width, q + width)}])),
        probability=draw(st.none() | st.floats(0, 1)),
        approximate=draw(st.none() | st.booleans()),
    )
    n = draw(st.floats(0, 1000))
    bump = Effect("bearing_harmonic", {"amplitude": draw(small), "n": n, "psi": draw(small)})
    return tuple(draw(st.lists(st.sampled_from([drag, bump]), unique=True)))


@given(
    numbers=st.fixed_dictionaries(
        {"gamma": st.floats(0, 1e300), "theta_r": st.floats(0, 1e300)}
        | dict.fromkeys(("p", "phase", "torque", "lab_time"), finite)
        | {"omega": st.floats(5e-324, 1e300)}
    ),
    acting=effects(),
    notes=notes,
)
@settings(max_examples=80)
def test_a_pendulum_reads_back_as_it_was_written(
    tmp_path: Path, numbers: dict[str, float], acting: tuple[Effect, ...], notes: dict[str, Any]
) -> None:
    model = Pendulum(**numbers, effects=acting, notes=notes)
    back = load_model(save_model(model, tmp_path / "model.toml"))
    assert back == model
    assert back.notes == notes
    assert pendmap.load_model(tmp_path / "model.toml") == model


@given(
    numbers=st.fixed_dictionaries(
        {name: st.floats(0, 1e6) for name in ("c_over_m", "Tr")}
        | dict.fromkeys(("p", "phi", "torque", "lab_time_s"), small)
        | {"w0": st.floats(1e-3, 1e3), "Omega": st.floats(1e-3, 1e6), "gravity": st.floats(1, 30)}
    ),
    acting=effects(),
    notes=notes,
)
@settings(max_examples=80)
def test_a_rig_reads_back_as_it_was_written(
    tmp_path: Path, numbers: dict[str, float], acting: tuple[Effect, ...], notes: dict[str, Any]
) -> None:
    model = Rig(**numbers, effects=acting, notes=notes)
    back = load_model(save_model(model, tmp_path / "model.toml"))
    assert back == model
    assert back.notes == notes


def test_a_file_in_si_and_one_without_dimensions_are_equivalent(tmp_path: Path) -> None:
    rig = load_model(written(tmp_path, EXAMPLE))
    assert isinstance(rig, Rig)
    bare = load_model(save_model(rig.pendulum, tmp_path / "bare.toml"))
    assert bare == rig.pendulum
    assert bare.effects[1].values == pytest.approx([0.6 / 6.2**2, 4, 0.1], rel=1e-15)
    assert "covariance" not in bare.notes


@pytest.mark.parametrize(
    ("text", "gamma"), [("gamma = 0.2", 0.2), ("zeta = 0.1", 0.2), ("zeta = 0.1\ngamma = 0.2", 0.2)]
)
def test_without_dimensions_zeta_is_half_of_gamma(tmp_path: Path, text: str, gamma: float) -> None:
    assert pendmap.load_model(written(tmp_path, f"[pendulum]\n{text}\n")).gamma == gamma


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbf[pendulum]\ngamma = 0.2\n",
        b"[pendulum]\r\ngamma = 0.2\r\n",
        b"pendulum = { gamma = 0.2 }",
        b"[pendulum]\ngamma = 0.2\n[provenance]\n",
    ],
    ids=["with a mark", "of Windows", "inline", "empty table"],
)
def test_unusual_valid_files_are_read(tmp_path: Path, text: bytes) -> None:
    assert load_model(written(tmp_path, text)) == Pendulum(gamma=0.2, p=0, omega=1)


KNOWN = (
    "it must be one of gamma, p, omega, phase, torque, theta_r, lab_time, zeta, or in SI w0, length"
)
VISCOUS = '[[effect]]\nname = "viscous_damping"\nparameters = { gamma = 0.2 }\n'
COULOMB = '[[effect]]\nname = "coulomb_friction"\nparameters = { theta_r = 0.2 }\n'
EFFECT = '[pendulum]\n[[effect]]\nname = "quadratic_drag"\n'


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "has no table [pendulum]"),
        ("gamma: 0.1", "not a TOML file: "),
        (b"x = " + b"[" * 100_000, "not a TOML file: "),
        (
            "[pendulum]\ngamma = 0.1\n[rig]\nw0 = 6\n",
            "[rig] is not known: it must be one of [pendulum]",
        ),
        (
            "gamma = 1\n[pendulum]\n",
            "gamma is not known: it must be one of [pendulum], [[formula]], [[effect]]",
        ),
        (
            "format_version = 2\n[pendulum]\n",
            "format_version must be a whole number from 1 to 1, got 2",
        ),
        ("covariance = 1\n[pendulum]\n", "covariance must be a table [covariance], got 1"),
        # keys
        (
            "[pendulum]\nc_over_n = 1\nw0 = 6\n",
            "c_over_n is not known: it must be c_over_m, in 1/s",
        ),
        ("[pendulum]\nlength_cm = 25\n", "length_cm is not known: it must be length_m, in m"),
        ("[pendulum]\nlab_time_h = 1\n", "it must be lab_time_s, in s"),
        ("[pendulum]\ngama = 1\n", f"gama is not known, perhaps gamma is meant: {KNOWN}"),
        ('[pendulum]\n"a\\nb" = 1\n', r"'a\nb' is not known"),
        # both kinds
        (
            "[pendulum]\nw0 = 6\ngamma = 0.1\n",
            "gamma has no dimensions and w0 is in SI: both must be of one kind; gamma is c_over_m",
        ),
        ("[pendulum]\nw0 = 6\nlab_time = 2\n", "lab_time is lab_time_s in SI"),
        # numbers
        ("[pendulum]\ngamma = 'x'\n", "gamma must be a number, got 'x'"),
        ("[pendulum]\ngamma = nan\n", "gamma must be a finite number, got nan"),
        ("[pendulum]\ngamma = true\n", "gamma must be a number, got True"),
        ("[pendulum]\np = 1\n", "p without omega: a drive needs a frequency above 0"),
        ("[pendulum]\nw0 = '6.2 rad/s'\n", "w0 must be a number, got '6.2 rad/s'"),
        ("[pendulum]\nc_over_m = 1\n", "w0 is missing: a model in SI needs w0 in rad/s, or length"),
        # contradictions
        (
            "[pendulum]\ngamma = 0.1\nzeta = 0.1\n",
            "gamma is 0.1, but 0.2 by 2 zeta of zeta = 0.1: they contradict, one of them must be",
        ),
        # effects
        ("[pendulum]\n[effect]\n", "effect must be [[effect]], one table each, got {}"),
        ("effect = [1]\n[pendulum]\n", "[[effect]] 1: must be a table, got 1"),
        ("[pendulum]\n[[effect]]\n", '[[effect]] 1: name must be given, like name = "quad'),
        (EFFECT, "[[effect]] 1: parameters must be given, like parameters = { q = 0.01 }"),
        (
            EFFECT + "q = 0.1\n",
            "[[effect]] 1: q is not known: it must be one of name, parameters, ci95",
        ),
        (EFFECT + "parameters = { k = 1 }\n", "parameters: k is not known: it must be one of q"),
        (
            EFFECT + "parameters = { q = 1 }\n" + EFFECT[11:] + "parameters = { q = 2 }\n",
            "quadratic_drag and quadratic_drag are the same effect: one of them must be left out",
        ),
        (
            '[pendulum]\n[[effect]]\nname = "magnetism"\nparameters = {}\n',
            "[[effect]] 1: name must be an effect of the library, got 'magnetism'",
        ),
        (
            "[pendulum]\ngamma = 0.1\n" + VISCOUS,
            "gamma is 0.1, the same term as the effect viscous_damping: one of them must",
        ),
    ],
)
def test_errors_are_reported_on_one_line(tmp_path: Path, text: str | bytes, complaint: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as error:
        load_model(path)
    assert str(error.value).startswith(f"{path}: ")
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(
    ("notes", "complaint"),
    [
        ({"rig": {}}, "rig is not known: it must be one of covariance, provenance"),
        ({"covariance": [1]}, r"covariance must be a table \[covariance\], got \[1\]"),
        ({"covariance": {"a": None}}, "NoneType"),
        ([1], r"notes must be a mapping, got \[1\]"),
    ],
)
def test_notes_that_are_no_tables_are_refused(
    tmp_path: Path,
    notes: Any,  # noqa: ANN401
    complaint: str,
) -> None:
    with pytest.raises(InputError, match=complaint):
        save_model(Pendulum(notes=notes), tmp_path / "model.toml")
    assert not list(tmp_path.iterdir())


def test_only_models_are_written_and_only_as_toml(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"model must be a Pendulum, like Pendulum\(p=0\.6\), got 3"
    ):
        save_model(3, tmp_path / "model.toml")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"suffix must be \.toml, got '\.json'"):
        save_model(Pendulum(), tmp_path / "model.json")
    with pytest.raises(FileNotFoundError):
        save_model(Pendulum(), tmp_path / "no" / "model.toml")
