"""Headings of loggers in nine languages, runs beside each other, and columns that are no angle."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest

import pendmap
from recorded import found, motion, noisy, read, text

if TYPE_CHECKING:
    from pathlib import Path

TIME, THETA, SPEED = motion(start=0.9, rate=50.0)
NOISE = 0.02 * np.random.default_rng(3).standard_normal((3, TIME.size))
SIZES = {"rad": 1.0, "deg": math.pi / 180, "gon": math.pi / 200, "turn": math.tau}
SIZES |= {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
# What a column may hold; a number after it is another of the kind
HELD = {
    "noise": NOISE[0],
    "drive": 0.5 * np.sin(9.1 * TIME + 1),
    "zero": 0 * TIME,
    "error": 1e-3 + 1e-4 * NOISE[1],
    "x": 0.4 * np.sin(THETA) + 0.02 * NOISE[1],
    "y": -0.4 * np.cos(THETA) + 0.02 * NOISE[2],
    "count": np.arange(TIME.size),
}
# Heading and columns: unit of the time, unit of the angle, unit of the velocity over s, or others
HEADINGS = """
Time (s);Angle (deg) | s deg
Latest: Time (s);Latest: Angle (rad);Latest: Angular Velocity (rad/s) | s rad rad/s
Time (s) Run #1;Angle (rad) Run #1 | s rad
Times (s);Angular Positions (degrees) | s deg
t_1;theta_1;omega_1 | s rad rad/s
millis;angleDeg | ms deg
ms since start;degrees | ms deg
seconds_elapsed;pitch;roll;yaw | s noise rad noise
t [msec];phi [gradians] | ms gon
t/s;θ/°;ω/(°/s) | s deg deg/s
t;d(theta)/dt;θ(t) | s rad/s rad
x-axis [second];Rotation [turns] | s turn
X;Y;Y' | s rad error
Time;Motor angle (deg);Pendulum angle (deg) | s drive deg
Time;Angle 1;Angle 2 | s drive rad
time;theta_std;theta_mean | s error rad
sample;time;angle (Â°) | count s deg
step;frame;t;θ | count count s rad
Frame;Time;bob X;bob Y;bob Z | count s noise x y
Time (s);X (mm);Y (mm);Z (mm) | s x noise y
time;x position (mm);y position (mm) | s x y
time;gyro_x_dps;gyro_y_dps | s noise deg/s
Zeit [ms];Winkel [Grad] | ms deg
Zeit in Sekunden;Auslenkung in Grad | s deg
Zeit;Pendelwinkel;Winkelgeschwindigkeit | s rad rad/s
Zeit;Sollwinkel;Istwinkel | s drive rad
Messzeit / min;Drehwinkel / Umdr | min turn
Temps (s);Angle (degrés) | s deg
Temps;Consigne;Vitesse angulaire (degrés par seconde);Position angulaire (°) | s drive deg/s deg
temps en secondes;thêta en radians | s rad
Tiempo (s);Ángulo (°) | s deg
tiempo_ms;angulo_grados;velocidad (grados/s) | ms deg deg/s
Tiempo;Referencia;Ángulo medido | s drive rad
Tempo_ms;Angulo_Real_graus;Alvo_graus | ms deg zero
tempo;ângulo do motor;ângulo do pêndulo | s drive rad
Tempo em segundos;Posição angular em graus | s deg
tempo_ms;angolo_gradi | ms deg
Tempo [s];Velocità angolare [rad/s];Posizione angolare [rad] | s rad/s rad
Tempo (secondi);Riferimento;Angolo (giri) | s drive turn
Czas [s];Kąt [°] | s deg
czas_ms;kat_stopnie | ms deg
Czas w sekundach;Kąt wychylenia w stopniach;Prędkość kątowa | s deg rad/s
tijd_s;hoek_graden | s deg
Tijd (ms);Hoeksnelheid (°/s);Slingerhoek (°) | ms deg/s deg
Tijd;Gewenste hoek;Hoek | s drive rad
时间(秒);角度(度) | s deg
时间/毫秒;角速度/(rad/s);摆角/rad | ms rad/s rad
时间,s;目标角度;实际角度（°） | s drive deg
"""


def column(kind: str) -> np.ndarray:
    """Return the values of a column."""
    if kind in HELD:
        return HELD[kind]
    unit, *second = kind.split("/")
    values = TIME if unit in {"s", "ms", "us", "min"} else SPEED if second else THETA
    return values / SIZES[unit]


@pytest.mark.parametrize("line", HEADINGS.strip().split("\n"))
def test_headings_of_nine_languages(tmp_path: Path, line: str) -> None:
    names, kinds = line.split(" | ")
    columns = [column(kind) for kind in kinds.split()]
    content = text(columns, "", "%.9g").replace(",", ";")
    run = read(tmp_path, f"{names}\n{content}")
    np.testing.assert_allclose(run.time, TIME, atol=1e-6)
    close = 0.05 if "angle" not in run.channels else 1e-6
    np.testing.assert_allclose(run.theta, THETA, atol=close)
    assert "angle-unit" not in found(run)
    if "/s" in kinds:
        assert run.velocity is not None
        np.testing.assert_allclose(run.velocity, SPEED, atol=1e-6)


@pytest.mark.parametrize(
    ("names", "scale", "says", "way"),
    [
        ("Zeit (s),Spannung (V)", 1.0, "the unit or scale of 'Spannung (V)'", "--angle-scale 1"),
        (
            "time_s,angle_counts",
            400.0,
            "the unit or scale of 'angle_counts'",
            "--counts-per-turn 2400",
        ),
        ("t,x (cm)", 30.0, "here 40 cm", "--angle 2 --angle-scale 0.025"),
        ("Temps (s),Déplacement (m)", 0.4, "here 0.4 m", "--angle 2 --angle-scale 2.5"),
        ("t,y", 300.0, "here 400 px", "--angle 2 --angle-scale 0.0025"),
        ("t,Winkel [Bq]", 1.0, "'Bq' is not known as a unit", "--angle 2 --angle-unit deg"),
    ],
)
def test_what_is_no_angle_is_refused_with_a_command(
    tmp_path: Path, names: str, scale: float, says: str, way: str
) -> None:
    with pytest.raises(pendmap.InputError, match=re.escape(says)) as error:
        read(tmp_path, text((TIME, scale * THETA), names))
    assert f"pendmap look {tmp_path / 'record.csv'} {way}" in str(error.value)


def test_counts_without_a_unit_are_refused_with_a_command(tmp_path: Path) -> None:
    way = "--angle-unit counts --counts-per-turn 2400"
    with pytest.raises(pendmap.InputError, match=way):
        read(tmp_path, text((TIME, np.round(2400 / math.tau * THETA)), "t,enc"))


def test_degrees_are_not_converted_twice(tmp_path: Path) -> None:
    run = read(tmp_path, text((TIME, 300 * THETA), "t,angle_deg"))
    assert "the unit or the scale is wrong" in found(run)["angle-unit"].text


@pytest.mark.parametrize("part", [np.cos(THETA), np.abs(THETA), 0.3 - 0.4 * np.cos(THETA)])
def test_what_swings_to_one_side_is_no_angle(tmp_path: Path, part: np.ndarray) -> None:
    with pytest.raises(pendmap.InputError, match="on one side of it"):
        read(tmp_path, text((TIME, part + 0.1 * NOISE[0]), "t,reading"))


def test_runs_beside_each_other_are_runs(tmp_path: Path) -> None:
    other = motion(start=0.5, duration=15.0, rate=50.0)[1]
    both = np.full((TIME.size, 6), np.nan)
    both[:, :3] = np.column_stack([TIME, THETA, SPEED])
    both[: other.size, 3:5] = np.column_stack([TIME[: other.size], other])
    both[: other.size, 5] = 0.0
    names = "t1,theta1,omega1,t2,theta2,omega2"
    (tmp_path / "two.csv").write_text(text(both.T, names).replace("nan", ""), encoding="utf-8")
    one, two = pendmap.read_experiment(tmp_path / "two.csv").runs
    assert (one.name, two.name) == ("two 1/2", "two 2/2")
    np.testing.assert_allclose(one.theta, THETA, atol=1e-6)
    np.testing.assert_allclose(two.theta, other, atol=1e-6)
    both[:, 3], both[:, 4] = TIME, 0.7 * THETA  # no run, but the first in another unit
    (tmp_path / "one.csv").write_text(text(both.T, names).replace("nan", ""), encoding="utf-8")
    (alone,) = pendmap.read_experiment(tmp_path / "one.csv").runs
    assert alone.unused == ("t2", "theta2", "omega2")


@pytest.mark.parametrize("names", ["t,x (m),y (m)", ""])
@pytest.mark.parametrize("drift", [0.0, 0.006])
def test_a_circle_is_found_in_a_frame_that_drifts(tmp_path: Path, names: str, drift: float) -> None:
    time, theta, _ = motion(start=0.4, duration=40.0, rate=30.0)
    noise = 1e-3 * np.random.default_rng(4).standard_normal((2, time.size))
    x, y = 0.333 * np.sin(theta), -0.333 * np.cos(theta) + drift * time / 40
    run = read(tmp_path, text((time, x + noise[0], y + noise[1]), names))
    said = re.search(r"radius (\S+) \+- (\S+),", found(run)["angle-from-pixels"].text)
    radius, error = map(float, said.groups())  # type: ignore[union-attr]
    assert abs(radius - 0.333) < 3 * error < 0.03
    assert ("frame-drifts" in found(run)) == (drift > 0)
    assert np.std(run.theta - theta) < 0.006


def test_without_names_a_phase_plane_is_no_circle(tmp_path: Path) -> None:
    time, theta, speed = motion(start=0.5)
    run = read(tmp_path, text((time, noisy(theta), speed / 6.2), ""))
    np.testing.assert_allclose(run.theta, theta, atol=0.01)
