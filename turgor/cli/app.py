"""The commands and their options; what they do lies in the rooms below."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

import turgor as tg
from turgor.cli import tables
from turgor.cli.failure import Commands, naming, tell, telling_warnings
from turgor.cli.output import print_json, print_table, print_text
from turgor.cli.progress import progress_on

app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

CaseFile = Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case file.", show_default=False)]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a key of the case, as in --set mesh.size='3 mm'."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output and nothing else there.")]


def _show_version(asked: bool) -> None:
    if asked:
        print_text(f"turgor {tg.__version__}")
        raise typer.Exit


@app.callback()
def turgor(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Soft pneumatic actuators, from a tensile test and a shape to their motion."""


@app.command()
def run(
    case_file: CaseFile,
    changes: Changes = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the run; the case's name if left out.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue a run that was cut short.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the run that is in the folder.")] = False,
    as_json: AsJson = False,
) -> None:
    """Run a case: find the rubber, mesh the shape, load it, measure, report."""
    with naming(case_file, changes or ()):
        case = tg.load_case(case_file, changes or ())
        folder = out or Path(case.name)
        with progress_on(Console(stderr=True)) as progress:
            done = tg.run(case, folder, resume=resume, overwrite=overwrite, progress=progress)
    if as_json:
        print_json(done.summary)
    else:
        print_table(tables.final(done.summary, done.folder))
    if not done.converged:
        tell(f"stopped short of the full load: {done.reason}")
        raise typer.Exit(tg.SolverError.exit_code)


@app.command()
def fit(
    data: Annotated[list[Path], typer.Argument(metavar="DATA.csv…", help="Tests to fit together.")],
    models: Annotated[
        list[str] | None, typer.Option("--model", metavar="NAME", help="Model to fit; all of them if left out.")
    ] = None,
    strain_range: Annotated[
        str | None, typer.Option(metavar="A:B", help="Strains between which the tests count, as in 0:3 or 0:300%.")
    ] = None,
    relative: Annotated[bool, typer.Option("--relative", help="Residuals count relative to the stress.")] = False,
    weights: Annotated[
        list[float] | None, typer.Option("--weight", metavar="W", help="Factor of a test, in the order of the tests.")
    ] = None,
    stability: Annotated[
        str, typer.Option(metavar="CHOICE", help="prefer, require or ignore fits that are stable.")
    ] = "prefer",
    stable_to: Annotated[
        float | None, typer.Option(metavar="STRETCH", help="How far to be stable; the tests' largest if left out.")
    ] = None,
    mode: Annotated[
        str | None, typer.Option(metavar="MODE", help="Kind of test, where the files do not say it.")
    ] = None,
    strain_source: Annotated[
        str | None, typer.Option(metavar="SOURCE", help="Of the strain: extensometer, video, crosshead or unknown.")
    ] = None,
    gauge_length: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="With which displacements become strain.")
    ] = None,
    effective_gauge_length: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Corrects the strain to the length that really stretched.")
    ] = None,
    area: Annotated[str | None, typer.Option(metavar="AREA", help="With which forces become stress.")] = None,
    known_modulus: Annotated[
        str | None, typer.Option(metavar="STRESS", help="Corrects the strain by the known stress at 100 % strain.")
    ] = None,
    remove_toe: Annotated[bool, typer.Option("--remove-toe", help="Count strain from the end of the toe.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.yaml", help="Write the recommended material for a case file.")
    ] = None,
    report: Annotated[Path | None, typer.Option(metavar="DIR", help="Write fit.html and fit.json there.")] = None,
    as_json: AsJson = False,
) -> None:
    """Fit material models to tensile and other tests."""
    read = [*data, *(models or ())]
    tg.check_targets([out], read)  # whose folder, other than that of the report, is not made
    tg.check_targets([out, *(tg.fit_report_files(report) if report else ())], read, makes_folder=True)
    tests = tg.read_tests(
        data,
        mode=mode,
        strain_source=strain_source,
        gauge_length=gauge_length,
        effective_gauge_length=effective_gauge_length,
        area=area,
        known_modulus=known_modulus,
        remove_toe=remove_toe,
    )
    fitted = tg.fit(
        tests,
        models or "all",
        strain_range=strain_range,
        error="relative" if relative else "absolute",
        weights=weights,
        stability=stability,  # type: ignore[arg-type]  # the fit says which choices there are
        stable_to=stable_to,
    )
    for test in fitted.tests:
        for text in (*test.dropped, *test.warnings):
            tell(f"{test.file}: {text}")
    if out:
        tg.write_material(fitted, out)
    if report:
        tg.write_fit_report(fitted, report)
    if as_json:
        print_json(fitted.as_dict())
    else:
        print_table(tables.fits(fitted))


@app.command()
def materials(
    name: Annotated[str | None, typer.Argument(help="One set of constants, in full.", show_default=False)] = None,
    as_json: AsJson = False,
) -> None:
    """List the published materials, or show one."""
    if name:
        entry = tg.find_material(name)
        facts = entry.as_dict() | {"assessment": tg.assess(entry.build).as_dict()}
        if as_json:
            print_json(facts)
        else:
            print_table(tables.pairs(name, facts))
    elif as_json:
        print_json([entry.as_dict() for entry in tg.library()])
    else:
        print_table(tables.library(tg.library()))


@app.command()
def templates(
    name: Annotated[str | None, typer.Argument(help="One template, with its parameters.", show_default=False)] = None,
    preview: Annotated[
        bool, typer.Option("--preview", help="Write a picture of it: drawing with all dimensions, and mesh.")
    ] = False,
    changes: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Parameter of the preview.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="The picture; NAME.png if left out.", show_default=False)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the actuator templates, or show the parameters or a picture of one."""
    if not preview and (changes or out):
        raise tg.InputError("--set and --out belong to a picture", expected="--preview")
    if preview:
        if not name:
            raise tg.InputError("a picture is one of a single template", expected="its name before --preview")
        path = out or Path(f"{name}.png")
        tg.check_targets([path], [])
        tg.preview(name, path, changes or ())
        if as_json:
            print_json({"template": name, "picture": str(path)})
        else:
            print_text(str(path))
        return
    known = [tg.template(name)] if name else list(tg.templates().values())
    if as_json:
        described = [tables.template_document(template) for template in known]
        print_json(described[0] if name else described)
    else:
        print_table(tables.parameters(known[0]) if name else tables.templates(known))


@app.command()
def mesh(
    case_file: CaseFile,
    changes: Changes = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Mesh file, .msh, .vtu or .vtk; the case's name with .vtu if left out."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Show the named parts, or where an STL surface is broken."),
    ] = None,
    quality_picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the quality of the elements and the worst one.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Mesh the actuator of a case, write the mesh and say how good it is."""
    with naming(case_file, changes or ()), telling_warnings():
        case = tg.load_draft(case_file, changes or ())
        path = out or Path(f"{case.name}.vtu")
        tg.check_targets([path, picture, quality_picture], [case_file, *case.files_read])
        tg.check_mesh_name(path)
        for image in filter(None, (picture, quality_picture)):
            tg.check_png(image)
        meshed = tg.mesh_case(case, picture)
    tg.write_mesh(meshed, path)
    if quality_picture:
        tg.draw_mesh(meshed, quality_picture, show="quality")
    facts = tables.mesh_document(meshed, path)
    if as_json:
        print_json(facts)
    else:
        print_table(tables.pairs(case.name, facts))


@app.command()
def export(
    case_file: CaseFile,
    changes: Changes = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Model: .inp (CalculiX, Abaqus; the case's name if left out) or .feb (FEBio)."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a case as a model that another program runs: mesh, materials, supports, loads and states."""
    with naming(case_file, changes or ()), telling_warnings():
        case = tg.load_case(case_file, changes or ())
        path = out or Path(f"{case.name}.inp")
        tg.check_targets([path], [case_file, *case.files_read])
        mesh = tg.export_case(case, path)
    facts = {"file": str(path), "elements": mesh.n_cells, "nodes": mesh.n_points}
    if as_json:
        print_json(facts)
    else:
        print_table(tables.pairs(case.name, facts))


@app.command()
def schema() -> None:
    """Print the JSON Schema of case files, by which an editor completes their keys."""
    print_json(tg.Case.model_json_schema())


@app.command()
def doctor(
    as_json: AsJson = False,
    missing_packages: Annotated[
        bool, typer.Option("--missing-packages", help="Print only the Debian packages that are missing, for scripts.")
    ] = False,
) -> None:
    """Say what Turgor stands on here: versions, threads, linear solver, and what is missing."""
    found = tg.environment()
    if missing_packages:
        print_text(" ".join(found["debian_packages"]))
        return
    if as_json:
        print_json(found)
    else:
        print_table(tables.environment(found))
    for sentence in found["missing"]:
        tell(sentence)
