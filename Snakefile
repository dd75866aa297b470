# From recordings to a report, one rule a section of the paper. Rules wire files to stages and hold no logic.

import sys
from pathlib import Path
from shlex import quote

sys.path.insert(0, workflow.basedir)

from schemas.errors import InputError
from stages.code_digest import code_digest
from stages.wiring import Wiring

try:
    study = Wiring.of(
        workflow.configfiles, config, Path(workflow.basedir, "config", "demo.yaml")
    )
except InputError as error:
    print(f"error: {error}", file=sys.stderr)
    sys.exit(2)

results = study.results.folder.as_posix()
of_recording = "sub-{subject}/{hand}/{recording}"
of_hand = "models/{model}/sub-{subject}/{hand}{without}"
stage = f"{quote(sys.executable)} -m stages."


report: "captions/workflow.rst"  # the first page of `snakemake --report`


shell.prefix(f"export PYTHONPATH={quote(str(workflow.basedir))} OMP_NUM_THREADS=1; ")


wildcard_constraints:
    subject="[^/]+",
    hand="right|left",
    task="[^/]+",
    recording="[^/]+",
    model="[^/]+",
    without="(/without-[^/]+)?",  # a skeleton made without a task's recordings, to be scored on them


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
        layout=study.layout,
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
        study.recording_file,
        mapping=study.mapping,
        layout=study.layout,
    output:
        f"{results}/{of_recording}/poses.parquet",
    log:
        f"{results}/logs/capture/sub-{{subject}}/{{hand}}/{{recording}}.log",
    params:
        code=code_digest("capture"),
        words=study.capture,
    shell:
        stage
        + "capture import --record-failure {params.words} --out {output:q} 2> {log:q}"


rule check_calibration:  # not in the paper: which joints should have moved more
    input:
        poses=study.calibrating,
        layout=study.layout,
    output:
        f"{results}/hands/sub-{{subject}}/{{hand}}/calibration_advice.parquet",
    log:
        f"{results}/logs/check_calibration/sub-{{subject}}/{{hand}}.log",
    params:
        code=code_digest("check_calibration"),
        whose=study.whose,
    shell:
        stage
        + "check_calibration --record-failure {params.whose} --poses {input.poses:q}"
        " --layout {input.layout:q} --out {output:q} > /dev/null 2> {log:q}"


rule solve_joints:  # section 4, Eq. 1-7: poses -> joint centres and axes
    input:
        poses=study.calibration,
        layout=study.layout,
        model=study.model,
    output:
        f"{results}/{of_hand}/joint_solutions.parquet",
    log:
        f"{results}/logs/solve_joints/{{model}}/sub-{{subject}}/{{hand}}{{without}}.log",
    params:
        code=code_digest("solve_joints"),
        whose=study.whose,
    shell:
        stage + "solve_joints --record-failure {params.whose} --poses {input.poses:q}"
        " --layout {input.layout:q} --model {input.model:q} --out {output:q} 2> {log:q}"


rule project_planes:  # end of section 4: the plane that cuts each axis; manual corrections
    input:
        joints=f"{results}/{of_hand}/joint_solutions.parquet",
        corrections=study.corrections,
        layout=study.layout,
        model=study.model,
    output:
        f"{results}/{of_hand}/projected_joints.parquet",
    log:
        f"{results}/logs/project_planes/{{model}}/sub-{{subject}}/{{hand}}{{without}}.log",
    params:
        code=code_digest("project_planes"),
    shell:
        stage
        + "project_planes --record-failure --joints {input.joints:q} --corrections {input.corrections:q}"
        " --layout {input.layout:q} --model {input.model:q} --out {output:q} 2> {log:q}"


rule fit_hand:  # not in the paper: the whole hand at once, and recordings posed with it
    input:
        poses=study.calibration,
        joints=f"{results}/{of_hand}/projected_joints.parquet",
        other=study.other_calibration,
        replay=study.evaluated,
        measurements=study.sheet("measurements"),
        touches=study.sheet("touches"),
        layout=study.layout,
        model=study.model,
    output:
        joints=f"{results}/{of_hand}/fitted_joints.parquet",
        bones=f"{results}/{of_hand}/fitted_bones.parquet",
        receivers=f"{results}/{of_hand}/receivers.parquet",
        gains=f"{results}/{of_hand}/gains.parquet",
        angles=f"{results}/{of_hand}/joint_angles.parquet",
        bone_poses=f"{results}/{of_hand}/bone_poses.parquet",
        tips=f"{results}/{of_hand}/posed_tips.parquet",
    log:
        f"{results}/logs/fit_hand/{{model}}/sub-{{subject}}/{{hand}}{{without}}.log",
    params:
        code=code_digest("fit_hand"),
        sizes=study.sizes,
    shell:
        stage
        + "fit_hand --record-failure {params.sizes} --poses {input.poses:q} --joints {input.joints:q}"
        " --other-poses {input.other:q} --replay {input.replay:q} --measurements {input.measurements:q}"
        " --touches {input.touches:q} --layout {input.layout:q} --model {input.model:q}"
        " --out {output.joints:q} --out-bones {output.bones:q} --out-receivers {output.receivers:q}"
        " --out-gains {output.gains:q} --out-angles {output.angles:q}"
        " --out-bone-poses {output.bone_poses:q} --out-tips {output.tips:q} 2> {log:q}"


rule estimate_metacarpals:  # section 5, Eq. 8-11: wrist point, bone lengths, metacarpal postures
    input:
        joints=study.joints,
        fitted_bones=study.fitted("fitted_bones"),
        bone_poses=study.fitted("bone_poses"),
        calibration=study.calibration,
        poses=study.evaluated,
        layout=study.layout,
        model=study.model,
    output:
        joints=f"{results}/{of_hand}/joint_centres.parquet",
        bones=f"{results}/{of_hand}/bone_lengths.parquet",
        metacarpals=f"{results}/{of_hand}/metacarpals.parquet",
    log:
        f"{results}/logs/estimate_metacarpals/{{model}}/sub-{{subject}}/{{hand}}{{without}}.log",
    params:
        code=code_digest("estimate_metacarpals"),
    shell:
        stage + "estimate_metacarpals --record-failure --joints {input.joints:q}"
        " --calibration {input.calibration:q} --poses {input.poses:q}"
        " --fitted-bones {input.fitted_bones:q} --bone-poses {input.bone_poses:q}"
        " --layout {input.layout:q} --model {input.model:q} --out-joints {output.joints:q}"
        " --out-bones {output.bones:q} --out {output.metacarpals:q} 2> {log:q}"


rule evaluate_tips:  # section 6: replay and tip errors
    input:
        poses=study.evaluated,
        calibration=study.calibration,
        joints=f"{results}/{of_hand}/joint_centres.parquet",
        bones=f"{results}/{of_hand}/bone_lengths.parquet",
        metacarpals=f"{results}/{of_hand}/metacarpals.parquet",
        layout=study.layout,
        model=study.model,
    output:
        tips=f"{results}/{of_hand}/tips.parquet",
        errors=f"{results}/{of_hand}/tip_errors.parquet",
    log:
        f"{results}/logs/evaluate_tips/{{model}}/sub-{{subject}}/{{hand}}{{without}}.log",
    params:
        code=code_digest("evaluate_tips"),
    shell:
        stage
        + "evaluate_tips --record-failure --poses {input.poses:q} --calibration {input.calibration:q}"
        " --joints {input.joints:q} --bones {input.bones:q} --metacarpals {input.metacarpals:q}"
        " --layout {input.layout:q} --model {input.model:q}"
        " --out {output.tips:q} --out-errors {output.errors:q} 2> {log:q}"


rule evaluate_skeletons:  # not in the paper: all models of a hand, on data that they have not seen
    input:
        study.skeleton_tables,
        poses=study.evaluated,
        calibration=study.calibrating,
        layout=study.layout,
    output:
        scores=f"{results}/hands/sub-{{subject}}/{{hand}}/skeleton_scores.parquet",
        errors=f"{results}/hands/sub-{{subject}}/{{hand}}/joint_errors.parquet",
    log:
        f"{results}/logs/evaluate_skeletons/sub-{{subject}}/{{hand}}.log",
    params:
        code=code_digest("evaluate_skeletons"),
        whose=study.whose,
        skeletons=study.skeletons,
        truth=study.truth,
    shell:
        stage
        + "evaluate_skeletons --record-failure {params.whose} --poses {input.poses:q}"
        " --calibration {input.calibration:q} --skeletons {params.skeletons:q} --truth {params.truth:q}"
        " --layout {input.layout:q} --out {output.scores:q} --out-joints {output.errors:q} 2> {log:q}"


rule gather:  # the study's tables, and what went wrong
    input:
        study.poses,
        study.every_table,
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
        study.exported,
        poses=f"{results}/{of_recording}/poses.parquet",
        layout=study.layout,
        model=study.model,
    output:
        directory(f"{results}/exports/{{model}}/{of_recording}"),
    log:
        f"{results}/logs/export/{{model}}/{of_recording}.log",
    params:
        code=code_digest("export"),
        study=study.file,
        results=results,
        words=study.export,
    shell:
        stage
        + "export --record-failure --study {params.study:q} --results {params.results:q} {params.words}"
        " --out {output:q} > /dev/null 2> {log:q}"


rule export_dataset:  # all recordings as one Motion-BIDS dataset
    input:
        study.dataset_sources,
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
        study.poses,
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
        study.of_subject,
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
        + "report.subject --record-failure --study {params.study:q} --results {params.results:q}"
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
