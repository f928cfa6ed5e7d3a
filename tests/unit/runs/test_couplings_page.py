"""The recipes of docs/couplings.md do what they say."""

import importlib.util
import re
import shutil
import sys
import tomllib
import types
from pathlib import Path

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.errors import RsmkitError
from rsmkit.io.toml_tables import read_tables
from rsmkit.runs.agenda import make_task
from rsmkit.runs.one_run.command import refuse_unused
from rsmkit.runs.one_run.execute import run_tasks
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.study.file import TAGGED, StudyFile

PAGE = (Path(__file__).parents[3] / "docs" / "couplings.md").read_text()


def blocks(section, language):
    """Blocks of code under a heading, by the name of the file in their first line."""
    text = re.search(rf"^## {section}.*?(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE)[0]
    found = re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
    return {block.split("\n")[0].lstrip("#*% "): block for block in found}


def recipe(section, name, folder):
    """Import one of a section's modules from a folder."""
    path = folder / name
    path.write_text(blocks(section, "python")[name])
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def study(section):
    """The tables of a section's study file, which must be in order."""
    tables, problems = read_tables(tomllib.loads(blocks(section, "toml")["study.toml"]), StudyFile, TAGGED)
    assert problems == []
    return tables


def program(folder, name, text):
    """Put a stand-in for a program on the search path."""
    (folder / "bin").mkdir(exist_ok=True)
    (folder / "bin" / name).write_text(f"#!{sys.executable}\nimport sys\n{text}")
    (folder / "bin" / name).chmod(0o755)


def made(section, folder, monkeypatch, **factors):
    """Make one run of a section's study, in a worker's own way."""
    monkeypatch.setenv("PATH", f"{folder / 'bin'}:/usr/bin:/bin")
    tables = study(section)
    simulator = Simulator(tables["simulator"], folder)
    refuse_unused(simulator, tables["factors"])
    assert tables["factors"].keys() == factors.keys()
    (outcome,) = run_tasks(simulator, [make_task(simulator, factors)], tuple(tables["responses"]))
    assert outcome.run.done, outcome.run.error
    return outcome.run.responses


def test_every_recipe_is_tested():
    sections = re.findall(r"^## (.*)", PAGE, re.MULTILINE)
    assert len(sections) == 8
    assert [
        section for section in sections if "```" not in PAGE.split(f"## {section}")[1].split("\n## ")[0]
    ] == []


def test_a_function_of_a_notebook_is_refused_with_what_to_do():
    def typed(x):
        return {"y": x}

    typed.__module__ = "__main__"
    with pytest.raises(RsmkitError, match="%%writefile"):
        rk.evaluate(typed, rk.full_factorial(rk.Space(x=(0, 1)), levels=2))


def test_fmu(tmp_path, monkeypatch):
    """The stand-in takes what ``fmpy.simulate_fmu`` of FMPy 0.3 takes and gives a table by name."""

    def simulate_fmu(filename, *, stop_time, start_values, output):
        assert filename == str(tmp_path / "model.fmu")
        times = np.linspace(0.0, stop_time, 11)
        table = np.zeros(11, [("time", float), *((name, float) for name in output)])
        table["height_m"] = start_values["mass_kg"] * times * (stop_time - times)
        table["speed_m_s"] = times
        return table

    monkeypatch.setitem(sys.modules, "fmpy", types.SimpleNamespace(simulate_fmu=simulate_fmu))
    found = recipe("FMU", "fmu_model.py", tmp_path).run(mass_kg=2.0)
    assert found == {"height_m": 0.0, "speed_m_s": 10.0, "height_m_max": 50.0, "speed_m_s_max": 10.0}
    assert {*study("FMU")["responses"]} <= {*found}


def test_fmpy_takes_what_the_recipe_gives():
    fmpy = pytest.importorskip("fmpy")
    import inspect

    inspect.signature(fmpy.simulate_fmu).bind("model.fmu", stop_time=1.0, start_values={}, output=[])


def test_an_openmdao_problem_is_a_simulator(tmp_path):
    pytest.importorskip("openmdao")
    module = recipe("OpenMDAO", "mdao_problem.py", tmp_path)
    assert module.run(force_N=3.0, speed_m_s=5.0) == {"power_W": 15.0}
    assert module.run(force_N=2.0, speed_m_s=5.0) == {"power_W": 10.0}


def test_surfaces_are_a_component_of_openmdao_with_exact_derivatives(tmp_path):
    om = pytest.importorskip("openmdao.api")
    component = recipe("OpenMDAO", "surface_component.py", tmp_path).SurfaceComponent
    design = rk.ccd(rk.Space(a=(0, 1), b=(2, 4)))
    a, b = design.points.T
    surface = rk.fit_surface(design.space, design.points, a * b + a**2, response="y")
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("s", component(surfaces={"y": surface}), promotes=["*"])
    problem.setup()
    problem.set_val("a", 0.25)
    problem.set_val("b", 3.0)
    problem.run_model()
    assert problem.get_val("y").item() == pytest.approx(0.25 * 3.0 + 0.0625, rel=1e-10)
    slopes = problem.compute_totals(of=["y"], wrt=["a", "b"])
    assert slopes["y", "a"].item() == pytest.approx(3.0 + 0.5, rel=1e-10)
    assert slopes["y", "b"].item() == pytest.approx(0.25, rel=1e-10)


def test_a_deck_of_finite_elements(tmp_path, monkeypatch):
    section = "Finite elements"
    (tmp_path / "beam.inp").write_text(blocks(section, "text")["beam.inp"])
    program(
        tmp_path,
        "ccx",
        "lines = open(sys.argv[1] + '.inp').read().splitlines()\n"
        "thickness = float(lines[lines.index('*SHELL SECTION, ELSET=BEAM, MATERIAL=STEEL') + 1])\n"
        "with open(sys.argv[1] + '.dat', 'w') as report:\n"
        "    report.write(f'displacements (vx,vy,vz) 12 0.0 {64 / thickness**3:.6e}\\n')\n",
    )
    assert made(section, tmp_path, monkeypatch, thickness_mm=4.0) == {"tip_mm": 1.0}


def test_octave(tmp_path, monkeypatch):
    if shutil.which("octave-cli") is None:
        program(
            tmp_path,
            "octave-cli",
            "import re\n"
            "assert sys.argv[1:3] == ['--quiet', '--path'] and sys.argv[4] == '--eval'\n"
            "span, chord = map(float, re.fullmatch(r'report\\((\\S+), (\\S+)\\)', sys.argv[5]).groups())\n"
            "print('{\"lift_N\": %.17g}' % (500 * span * chord))\n",
        )
    (tmp_path / "report.m").write_text(blocks("MATLAB", "text")["report.m"])
    assert made("MATLAB", tmp_path, monkeypatch, span_m=10.0, chord_m=1.5) == {"lift_N": 7500.0}


def test_docker(tmp_path, monkeypatch):
    program(
        tmp_path,
        "docker",
        "from pathlib import Path\n"
        "assert sys.argv[1:3] == ['run', '--rm'] and sys.argv[-3:-1] == ['solver:1.2', 'solve']\n"
        "(volume,) = [word for word in sys.argv if word.startswith('--volume=')]\n"
        "assert Path(volume.split('=')[1].split(':')[0]).samefile('.')\n"
        "print('{\"drag_N\": %s}' % sys.argv[-1].partition('=')[2])\n",
    )
    assert made("Docker", tmp_path, monkeypatch, radius_m=0.25) == {"drag_N": 0.25}


def test_ssh(tmp_path, monkeypatch):
    program(
        tmp_path,
        "ssh",
        "assert sys.argv[-2] == 'cruncher' and '-oBatchMode=yes' in sys.argv\n"
        "print('{\"drag_N\": %s}' % sys.argv[-1].partition('=')[2])\n",
    )
    assert made("Another computer", tmp_path, monkeypatch, radius_m=0.25) == {"drag_N": 0.25}


def workbook(folder):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active["B4"] = "=B1*B2/4"
    book.save(folder / "model.xlsx")
    return openpyxl


def test_a_spreadsheet_is_filled_in_and_read(tmp_path, monkeypatch):
    """The stand-in calculates the one formula as LibreOffice would."""
    openpyxl = workbook(tmp_path)

    def soffice(words, **how):
        assert words[0] == "soffice"
        sheet = openpyxl.load_workbook(words[-1])
        sheet.active["B4"] = sheet.active["B1"].value * sheet.active["B2"].value / 4
        Path(words[-2]).mkdir()
        sheet.save(f"{words[-2]}/in.xlsx")

    module = recipe("A spreadsheet", "sheet.py", tmp_path)
    monkeypatch.setattr(module.subprocess, "run", soffice)
    assert module.run(length_m=3.0, load_N=100.0) == {"moment_N_m": 75.0}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("soffice") is None, reason="needs LibreOffice")
def test_libreoffice_calculates_the_spreadsheet(tmp_path):
    workbook(tmp_path)
    found = recipe("A spreadsheet", "sheet.py", tmp_path).run(length_m=3.0, load_N=100.0)
    assert found == {"moment_N_m": 75.0}
