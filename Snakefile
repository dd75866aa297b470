# From recordings to a report, one rule a section of the paper. Rules wire files to stages and hold no logic.

import sys
from pathlib import Path
from shlex import quote

sys.path.insert(0, workflow.basedir)

from schemas.errors import InputError
from stages.code_digest import code_digest, keep
from stages.wiring import Wiring

try:
    study = Wiring.of(
        workflow.configfiles, config, Path(workflow.basedir, "config", "demo.yaml")
    )
except InputError as error:
    print(f"error: {error}", file=sys.stderr)
    sys.exit(2)

results = study.results.folder.as_posix()
stage = f"{quote(sys.executable)} -m stages."


def each(name):
    """Run a stage for all units of a job: a subject's hands and models, or a hand's."""
    return (
        f"{stage}job each {name} --code {{params.code}} --made {{output:q}} > /dev/null 2> {{log:q}}"
        " <<'UNITS'\n{params.units}\nUNITS"
    )


report: "captions/workflow.rst"  # the first page of `snakemake --report`


shell.prefix(f"export PYTHONPATH={quote(str(workflow.basedir))} OMP_NUM_THREADS=1; ")


onstart:
    study.prepare(workflow)
    keep()


wildcard_constraints:
    subject="[^/]+",
    hand="right|left",
    task="[^/]+",


rule all:
    input:
        f"{results}/report.html",
        study.subject_pages,
        study.figures,
        study.exports,


rule simulate:  # only what a study with `simulation` asks for: recordings, and the truth beside them
    output:
        study.simulated,
    log:
        f"{results}/logs/simulate/sub-{{subject}}/{{hand}}/{{task}}.log",
    params:
        code=code_digest("simulate"),
        words=study.simulate,
    shell:
        stage + "simulate {params.words} --out {output:q} 2> {log:q}"


rule stream:  # the simulated tracker's end of the line: recordings -> raw captures
    input:
        study.simulated,
        layout=study.layouts,
    output:
        study.streamed,
    log:
        f"{results}/logs/stream/sub-{{subject}}/{{hand}}/{{task}}.log",
    params:
        code=code_digest("capture"),
    shell:
        stage
        + "capture emulate --recording {input[0]:q} --layout {input.layout:q} --archive {output:q} 2> {log:q}"


rule capture:  # section 2: recordings -> poses
    input:
        study.recording_files,
        layouts=study.layouts,
    output:
        study.made("capture"),
    log:
        f"{results}/logs/capture/sub-{{subject}}.log",
    params:
        code=code_digest("capture"),
        gone=study.gone("capture"),
        units=study.capture,
    shell:
        each("capture.import_recording")


rule check_calibration:  # not in the paper: which joints should have moved more
    input:
        study.of_subject("capture"),
        layouts=study.layouts,
    output:
        study.made("check_calibration"),
    log:
        f"{results}/logs/check_calibration/sub-{{subject}}.log",
    params:
        code=code_digest("check_calibration"),
        gone=study.gone("check_calibration"),
        units=study.check_calibration,
    shell:
        each("check_calibration")


rule solve_joints:  # section 4, Eq. 1-7: poses -> joint centres and axes
    input:
        study.of_subject("capture"),
        layouts=study.layouts,
        models=list(study.models.values()),
    output:
        study.made("solve_joints"),
    log:
        f"{results}/logs/solve_joints/sub-{{subject}}.log",
    params:
        code=code_digest("solve_joints"),
        gone=study.gone("solve_joints"),
        units=study.solve_joints,
    shell:
        each("solve_joints")


rule project_planes:  # end of section 4: the plane that cuts each axis; manual corrections
    input:
        study.of_subject("solve_joints"),
        layouts=study.layouts,
        models=list(study.models.values()),
    output:
        study.made("project_planes"),
    log:
        f"{results}/logs/project_planes/sub-{{subject}}.log",
    params:
        code=code_digest("project_planes"),
        gone=study.gone("project_planes"),
        units=study.project_planes,
        corrections=study.corrections,
    shell:
        each("project_planes")


rule fit_hand:  # not in the paper: the whole hand at once, and recordings posed with it
    input:
        study.of_subject("project_planes"),
        study.sheets_of_fit,
        layouts=study.layouts,
        models=list(study.models.values()),
    output:
        study.made("fit_hand"),
    log:
        f"{results}/logs/fit_hand/sub-{{subject}}/{{hand}}.log",
    params:
        code=code_digest("fit_hand"),
        gone=study.gone("fit_hand"),
        units=study.fit_hand,
    shell:
        each("fit_hand")


rule estimate_metacarpals:  # section 5, Eq. 8-11: wrist point, bone lengths, metacarpal postures
    input:
        study.of_subject("project_planes", "fit_hand"),
        layouts=study.layouts,
        models=list(study.models.values()),
    output:
        study.made("estimate_metacarpals"),
    log:
        f"{results}/logs/estimate_metacarpals/sub-{{subject}}.log",
    params:
        code=code_digest("estimate_metacarpals"),
        gone=study.gone("estimate_metacarpals"),
        units=study.estimate_metacarpals,
    shell:
        each("estimate_metacarpals")


rule evaluate_tips:  # section 6: replay and tip errors
    input:
        study.of_subject("estimate_metacarpals"),
        layouts=study.layouts,
        models=list(study.models.values()),
    output:
        study.made("evaluate_tips"),
    log:
        f"{results}/logs/evaluate_tips/sub-{{subject}}.log",
    params:
        code=code_digest("evaluate_tips"),
        gone=study.gone("evaluate_tips"),
        units=study.evaluate_tips,
    shell:
        each("evaluate_tips")


rule evaluate_skeletons:  # not in the paper: all models of a hand, on data that they have not seen
    input:
        study.of_subject("evaluate_tips"),
        layouts=study.layouts,
    output:
        study.made("evaluate_skeletons"),
    log:
        f"{results}/logs/evaluate_skeletons/sub-{{subject}}.log",
    params:
        code=code_digest("evaluate_skeletons"),
        gone=study.gone("evaluate_skeletons"),
        units=study.evaluate_skeletons,
    shell:
        each("evaluate_skeletons")


rule gather:  # the study's tables, and what went wrong
    input:
        study.of_study(*study.last_stages),
        configuration=study.configuration,
    output:
        [f"{results}/{table}.parquet" for table in study.study_tables],
        f"{results}/resolved.yaml",
    log:
        f"{results}/logs/gather.log",
    params:
        code=code_digest("gather"),
        study=study.file,
        results=results,
    shell:
        stage
        + "gather --study {params.study:q} --results {params.results:q} 2> {log:q}"


rule export:  # the skeleton and its motion for other programs
    input:
        study.of_subject("evaluate_tips"),
        layouts=study.layouts,
        models=list(study.models.values()),
    output:
        study.made("export"),
    log:
        f"{results}/logs/export/sub-{{subject}}.log",
    params:
        code=code_digest("export"),
        gone=study.gone("export"),
        units=study.export,
    shell:
        each("export")


rule export_dataset:  # all recordings as one Motion-BIDS dataset
    input:
        study.of_study("capture", "evaluate_tips"),
        list(study.models.values()),
        configuration=study.configuration,
    output:
        directory(f"{results}/exports/bids"),
    log:
        f"{results}/logs/export_dataset.log",
    params:
        code=code_digest("export"),
        study=study.file,
        results=results,
        words=study.export_dataset,
    shell:
        stage
        + "export.dataset --record-failure --study {params.study:q} --results {params.results:q}"
        " {params.words} --out {output:q} > /dev/null 2> {log:q}"


rule report:
    input:
        study.exports,
        [f"{results}/{table}.parquet" for table in study.study_tables],
        list(study.models.values()),
        configuration=study.configuration,
    output:
        report(
            f"{results}/report.html",
            caption="captions/report.rst",
            category="Study",
            labels={"page": study.study.name},
        ),
    log:
        f"{results}/logs/report.log",
    params:
        code=code_digest("report"),
        study=study.file,
        results=results,
    shell:
        stage
        + "report --study {params.study:q} --results {params.results:q} --out {output:q} 2> {log:q}"


rule subject_pages:  # the report's pages of a subject and of each of its recordings
    input:
        study.of_subject(*study.last_stages),
        list(study.models.values()),
    output:
        directory(f"{results}/report/sub-{{subject}}"),
    log:
        f"{results}/logs/subject_pages/sub-{{subject}}.log",
    params:
        code=code_digest("report"),
        study=study.file,
        results=results,
        subject=study.subject,
        rows=study.rows_of_subject,
    shell:
        stage
        + "job report.subject --record-failure --study {params.study:q} --results {params.results:q}"
        " {params.subject} --out {output:q} 2> {log:q}"


rule draw_figures:  # the study's figures for print; each is written, if only to say what it lacks
    input:
        [f"{results}/{table}.parquet" for table in study.study_tables],
        list(study.models.values()),
        configuration=study.configuration,
    output:
        [
            report(
                f"{results}/figures/{name}.svg",
                caption=f"captions/{name}.rst",
                category="Figures",
                labels={"figure": name},
            )
            for name in study.figure_names
        ],
        [
            f"{results}/figures/{name}.{kind}"
            for name in study.figure_names
            for kind in ("pdf", "txt")
        ],
    log:
        f"{results}/logs/draw_figures.log",
    params:
        code=code_digest("draw_figures"),
        study=study.file,
        results=results,
    shell:
        stage
        + "draw_figures --record-failure --study {params.study:q} --results {params.results:q}"
        " --out {params.results:q}/figures 2> {log:q}"
