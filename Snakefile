# From recordings to a report, one rule a section of the paper. Rules wire files to stages and hold no logic.

import os
import sys
from pathlib import Path
from shlex import quote

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger
from snakemake.settings.types import Quietness

here = Path(workflow.snakefile).resolve().parent
own_package = (here / "shukotsu").is_dir()  # in a checkout: not the one installed
if own_package:
    sys.path.insert(0, str(here))
    # for jobs; not in their commands, which would make them run again where the checkout has moved
    paths = [str(here), os.getenv("PYTHONPATH")]
    os.environ.update(PYTHONPATH=os.pathsep.join(filter(None, paths)))
own = [here / "Snakefile", here / "workflow" / "Snakefile"]
is_module = Path(workflow.main_snakefile).resolve() not in own  # of another Snakefile
if not is_module:  # nothing is imported from the folder that this runs in
    os.environ.update(PYTHONSAFEPATH="1")

from shukotsu.errors import InputError
from shukotsu.schemas.results import FIT_TABLES, MEASURED_TABLES
from shukotsu.workflow import failed_jobs, made_from, warm_process
from shukotsu.workflow.file_digests import program_digest
from shukotsu.workflow.study_files import StudyFiles, study_file

try:
    study = StudyFiles(study_file(workflow.configfiles, config, is_module))
    if workflow.is_main_process:
        for row in study.study.unusable:
            print(f"note: {row.message}", file=sys.stderr)
        if note := study.what_is_not_as_made():
            print(f"note: {note}", file=sys.stderr)
except InputError as error:
    raise WorkflowError(str(error)) from None

results = study.results.folder.as_posix()
subject = f"{results}/sub-{{subject}}"
fit = f"{subject}/fits/{{hand}}/{{model}}"
logs = f"{results}/logs"
code = program_digest()
run = f"PYTHONSAFEPATH=1 {quote(sys.executable)} -m shukotsu.workflow.job"


report: "captions/workflow.rst"  # the first page of `snakemake --report`


container: "shukotsu.sif"  # of container/Dockerfile: for a whole run (docs/cluster.md), no job needs it


if workflow.is_main_process and Quietness.RULES in (
    workflow.output_settings.quiet or ()
):  # as `shukotsu run` asks
    logger.addFilter(failed_jobs.FailedJobs(workflow, study.results.folder))


onstart:
    failed_jobs.refuse(workflow, study.results.folder)
    for note in filter(None, (study.what_changed(), study.remove_former())):
        print(f"note: {note}", file=sys.stderr)
    study.write_changed_plans()
    warm_process.start()


onsuccess:
    made_from.keep(study.kept, workflow)


onerror:
    made_from.keep(study.kept, workflow)


wildcard_constraints:
    subject="[^/]+",
    hand="right|left",
    task="[^/]+",
    recording="[^/]+",
    model="[^/]+",


rule all:
    input:
        study.outputs,
        study.plans,


rule plan:  # what the stages need to know of the study about a subject
    output:
        f"{subject}/plan.json",
    log:
        f"{logs}/plan/sub-{{subject}}.log",
    params:  # a function of `output` is no reason to run again: changed plans are written when a run begins
        options=lambda wildcards, output: f"{study.options} {study.subject_options(wildcards)}",
    message:
        "plan: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.workflow.write_plan {{params.options}} --out {{output:q}} 2> {{log:q}}"


rule simulate:  # only for a study with `simulation`: recordings, and the truth beside them
    output:
        recording=study.simulated,
        truth=study.simulated_truth,
    log:
        f"{logs}/simulate/sub-{{subject}}_hand-{{hand}}_task-{{task}}.log",
    params:
        code=code,
        subject=study.subject_options,
        seed=study.seed,
    message:
        "simulate: subject {wildcards.subject}, {wildcards.hand} hand, {wildcards.task}"
    shell:
        f"{run} shukotsu.stages.simulate {{params.subject}} --hand {{wildcards.hand}}"
        " --task {wildcards.task:q} --seed {params.seed} --out {output.recording:q} 2> {log:q}"


rule stream:  # the simulated tracker's end of the line: recordings -> raw captures
    input:
        recording=study.simulated,
        layout=ancient(study.layout),
    output:
        study.streamed,
    log:
        f"{logs}/stream/sub-{{subject}}_hand-{{hand}}_task-{{task}}.log",
    params:
        code=code,
        layout=study.layout_digest,
    message:
        "stream: subject {wildcards.subject}, {wildcards.hand} hand, {wildcards.task}"
    shell:
        f"{run} shukotsu.stages.capture.emulate_tracker --recording {{input.recording:q}} --layout {{input.layout:q}}"
        " --archive {output:q} 2> {log:q}"


rule capture:  # section 2: a recording -> its poses
    input:
        study.simulated_recording,
        ancient(study.recording_files),
    output:
        f"{subject}/{{hand}}/{{recording}}/poses.parquet",
    log:
        f"{logs}/capture/sub-{{subject}}_hand-{{hand}}_{{recording}}.log",
    resources:
        **study.resources(1, 10),
    params:
        code=code,
        layout=study.layout_digest,
        options=study.import_options,
        files=study.recording_digest,
    message:
        "capture: subject {wildcards.subject}, {wildcards.hand} hand, {wildcards.recording}"
    shell:
        f"{run} shukotsu.stages.capture.import_recording --record-failure {{params.options}} --out {{output:q}}"
        " > /dev/null 2> {log:q}"


rule check_recordings:  # not in the paper: what was declared, against what the poses say
    input:
        poses=study.poses,
        plan=ancient(f"{subject}/plan.json"),
    output:
        f"{subject}/findings.parquet",
    log:
        f"{logs}/check_recordings/sub-{{subject}}.log",
    resources:
        **study.resources(1, 5, 2200),
    params:
        code=code,
        plan=study.recordings_plan,
    message:
        "check_recordings: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.check_recordings --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}} --out {{output:q}}"
        " > /dev/null 2> {log:q}"


rule align_events:  # not in the paper: notes, markers and pulses, on each recording's own clock
    input:
        poses=study.poses,
        event_files=ancient(study.event_files),
        plan=ancient(f"{subject}/plan.json"),
    output:
        events=f"{subject}/events.parquet",
        clocks=f"{subject}/clocks.parquet",
    log:
        f"{logs}/align_events/sub-{{subject}}.log",
    resources:
        **study.resources(1, 2),
    params:
        code=code,
        files=study.event_digest,
        plan=study.recordings_plan,
    message:
        "align_events: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.align_events --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}} --out {{output.events:q}}"
        " --out-clocks {output.clocks:q} 2> {log:q}"


rule solve_joints:  # section 4, Eq. 1-7: poses -> joint centres and axes
    input:
        poses=study.poses,
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
    output:
        f"{subject}/joint_solutions.parquet",
    log:
        f"{logs}/solve_joints/sub-{{subject}}.log",
    resources:
        **study.resources(1, 5),
    params:
        code=code,
        plan=study.plan,
    message:
        "solve_joints: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.solve_joints --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}}"
        " --findings {input.findings:q} --out {output:q} 2> {log:q}"


rule project_planes:  # end of section 4: the plane that cuts each axis; manual corrections
    input:
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
        joint_solutions=f"{subject}/joint_solutions.parquet",
    output:
        f"{subject}/projected_joints.parquet",
    log:
        f"{logs}/project_planes/sub-{{subject}}.log",
    params:
        code=code,
        plan=study.plan,
    message:
        "project_planes: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.project_planes --record-failure --plan {{input.plan:q}} --findings {{input.findings:q}}"
        " --joint-solutions {input.joint_solutions:q} --out {output:q} 2> {log:q}"


rule fit_hand:  # not in the paper: a whole hand at once, and its recordings posed with it
    input:
        poses=study.poses_of_fit,
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
    output:
        [f"{fit}/{table}.parquet" for table in FIT_TABLES],
    log:
        f"{logs}/fit_hand/sub-{{subject}}_hand-{{hand}}_model-{{model}}.log",
    resources:
        **study.resources(3, 30),
    params:
        code=code,
        plan=study.fit_plan,
        model=study.model,
        out=f"--out={fit}",
    message:
        "fit_hand: subject {wildcards.subject}, {wildcards.hand} hand, model {wildcards.model}"
    shell:
        f"{run} shukotsu.stages.fit_hand --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}} --findings {{input.findings:q}}"
        " --hand {wildcards.hand} --model {params.model:q} {params.out:q} 2> {log:q}"


rule estimate_metacarpals:  # section 5, Eq. 8-11: wrist point, bone lengths, metacarpal postures
    input:
        poses=study.poses,
        **study.fits("fitted_joints", "fitted_bones", "bone_poses"),
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
        projected_joints=f"{subject}/projected_joints.parquet",
    output:
        joints=f"{subject}/joint_centres.parquet",
        bones=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
    log:
        f"{logs}/estimate_metacarpals/sub-{{subject}}.log",
    resources:
        **study.resources(1, 10),
    params:
        code=code,
        plan=study.plan,
    message:
        "estimate_metacarpals: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.estimate_metacarpals --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}}"
        " --findings {input.findings:q} --projected-joints {input.projected_joints:q} --fitted-joints {input.fitted_joints:q} --fitted-bones {input.fitted_bones:q} --bone-poses {input.bone_poses:q}"
        " --out-joints {output.joints:q} --out-bones {output.bones:q}"
        " --out {output.metacarpals:q} 2> {log:q}"


rule evaluate_tips:  # section 6: replay and tip errors
    input:
        poses=study.poses,
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
        joint_centres=f"{subject}/joint_centres.parquet",
        bone_lengths=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
    output:
        tips=f"{subject}/tips.parquet",
        errors=f"{subject}/tip_errors.parquet",
    log:
        f"{logs}/evaluate_tips/sub-{{subject}}.log",
    resources:
        **study.resources(1, 10),
    params:
        code=code,
        plan=study.plan,
    message:
        "evaluate_tips: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.evaluate_tips --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}}"
        " --findings {input.findings:q} --joint-centres {input.joint_centres:q} --bone-lengths {input.bone_lengths:q} --metacarpals {input.metacarpals:q}"
        " --out {output.tips:q}"
        " --out-errors {output.errors:q} 2> {log:q}"


rule evaluate_skeletons:  # not in the paper: all models of a hand, on data that they have not seen
    input:
        poses=study.poses,
        truth=study.truth,
        **study.fits("posed_tips", "bone_poses", "fitted_joints", "fitted_bones", references=True),
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
        joint_centres=f"{subject}/joint_centres.parquet",
        bone_lengths=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
        tips=f"{subject}/tips.parquet",
        tip_errors=f"{subject}/tip_errors.parquet",
    output:
        scores=f"{subject}/skeleton_scores.parquet",
        errors=f"{subject}/joint_errors.parquet",
    log:
        f"{logs}/evaluate_skeletons/sub-{{subject}}.log",
    resources:
        **study.resources(2, 10, 2200),
    params:
        code=code,
        plan=study.plan,
    message:
        "evaluate_skeletons: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.evaluate_skeletons --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}}"
        " --findings {input.findings:q} --joint-centres {input.joint_centres:q} --bone-lengths {input.bone_lengths:q} --metacarpals {input.metacarpals:q}"
        " --tips {input.tips:q} --tip-errors {input.tip_errors:q} --posed-tips {input.posed_tips:q} --bone-poses {input.bone_poses:q} --fitted-joints {input.fitted_joints:q} --fitted-bones {input.fitted_bones:q}"
        " --out {output.scores:q} --out-joints {output.errors:q} 2> {log:q}"


rule measure_movement:  # not in the paper: ranges, speeds, cycles, ways of the fingertips, strokes at events
    input:
        poses=study.poses,
        **study.fits("joint_angles", "posed_tips", "bone_poses", "moved_receivers"),
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
        joint_centres=f"{subject}/joint_centres.parquet",
        bone_lengths=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
        events=f"{subject}/events.parquet",
        clocks=f"{subject}/clocks.parquet",
    output:
        [f"{subject}/{table}.parquet" for table in MEASURED_TABLES],
    log:
        f"{logs}/measure_movement/sub-{{subject}}.log",
    resources:
        **study.resources(1, 20),
    params:
        code=code,
        plan=study.plan,
        out=f"--out={subject}",
    message:
        "measure_movement: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.measure_movement --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}}"
        " --findings {input.findings:q} --joint-centres {input.joint_centres:q} --bone-lengths {input.bone_lengths:q} --metacarpals {input.metacarpals:q}"
        " --joint-angles {input.joint_angles:q} --posed-tips {input.posed_tips:q} --bone-poses {input.bone_poses:q} --moved-receivers {input.moved_receivers:q}"
        " --events {input.events:q} --clocks {input.clocks:q} {params.out:q} 2> {log:q}"


rule gather:  # the study's short tables, and what went wrong
    input:
        study.gathered,
        poses=study.all_poses,
        plans=ancient(study.plans),
        configuration=ancient(study.configuration),
    output:
        study.study_tables,
        f"{results}/resolved.yaml",
    log:
        f"{logs}/gather.log",
    params:
        code=code,
        configuration=study.configuration_digest,
        plans=study.plans_digest,
        study=study.options,
    message:
        "gather: the study's tables"
    shell:
        f"{run} shukotsu.stages.gather {{params.study}} 2> {{log:q}}"


rule compare_models:  # not in the paper: how the skeleton models differ over the subjects
    input:
        study.study_tables,
        configuration=ancient(study.configuration),
    output:
        study.model_comparisons,
    log:
        f"{logs}/compare_models.log",
    params:
        code=code,
        configuration=study.configuration_digest,
        study=study.options,
    message:
        "compare_models: how the skeleton models differ"
    shell:
        f"{run} shukotsu.stages.compare_models {{params.study}} 2> {{log:q}}"


rule compare_movement:  # not in the paper: how subjects, sessions and tasks differ, and how well it repeats
    input:
        study.study_tables,
        configuration=ancient(study.configuration),
    output:
        study.movement_comparisons,
    log:
        f"{logs}/compare_movement.log",
    params:
        code=code,
        configuration=study.configuration_digest,
        study=study.options,
    message:
        "compare_movement: how subjects, sessions and tasks differ"
    shell:
        f"{run} shukotsu.stages.compare_movement {{params.study}} 2> {{log:q}}"


rule export:  # skeletons and their motion for other programs
    input:
        poses=study.poses,
        **study.fits("joint_angles", "posed_tips", "bone_poses", "moved_receivers"),
        plan=ancient(f"{subject}/plan.json"),
        findings=f"{subject}/findings.parquet",
        joint_centres=f"{subject}/joint_centres.parquet",
        bone_lengths=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
    output:
        directory(f"{subject}/exports"),
    log:
        f"{logs}/export/sub-{{subject}}.log",
    resources:
        **study.resources(1, 60, 2000),
    params:
        code=code,
        plan=study.plan,
        formats=",".join(study.export_formats),
        options=study.export_options,
    message:
        "export: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.export --record-failure --plan {{input.plan:q}} --poses {{input.poses:q}}"
        " --findings {input.findings:q} --joint-centres {input.joint_centres:q} --bone-lengths {input.bone_lengths:q} --metacarpals {input.metacarpals:q}"
        " --joint-angles {input.joint_angles:q} --posed-tips {input.posed_tips:q} --bone-poses {input.bone_poses:q} --moved-receivers {input.moved_receivers:q} --formats {params.formats}"
        " {params.options} --out {output:q} > /dev/null 2> {log:q}"


rule export_dataset:  # all recordings as one Motion-BIDS dataset
    input:
        study.exported,
        plans=ancient(study.plans),
        configuration=ancient(study.configuration),
    output:
        directory(f"{results}/dataset"),
    log:
        f"{logs}/export_dataset.log",
    params:
        code=code,
        configuration=study.configuration_digest,
        plans=study.plans_digest,
        options=study.export_options,
        participants=study.participants,
    message:
        "export_dataset: the study as a Motion-BIDS dataset"
    shell:
        f"{run} shukotsu.stages.export --record-failure --plan {{input.plans:q}} --formats bids {{params.options}}"
        " {params.participants} --out {output:q} > /dev/null 2> {log:q}"


rule export_tables:  # the study's tables for R and others, with a data dictionary
    input:
        study.study_tables,
        study.model_comparisons,
        study.movement_comparisons,
    output:
        directory(f"{results}/tidy"),
    log:
        f"{logs}/export_tables.log",
    params:
        code=code,
        name=study.study.name,
    message:
        "export_tables: the study's tables as CSV, with what their columns mean"
    shell:
        f"{run} shukotsu.stages.export.tables --tables {{input:q}} --study {{params.name:q}} --out {{output:q}} 2> {{log:q}}"


rule collect_exports:  # of all subjects in one flat folder, by links: they take no room twice
    input:
        study.export_folders,
    output:
        directory(f"{results}/exports"),
    log:
        f"{logs}/collect_exports.log",
    params:
        code=code,
    message:
        "collect_exports: the exports of all subjects in one folder"
    shell:
        f"{run} shukotsu.stages.export.collect --folders {{input:q}} --out {{output:q}} 2> {{log:q}}"


rule report:  # it names the pages that could not be made
    input:
        study.tables,
        study.exports,
        study.subject_pages,
        study.study_tables,
        study.model_comparisons,
        study.movement_comparisons,
        configuration=ancient(study.configuration),
    output:
        report(
            f"{results}/report.html",
            caption="captions/report.rst",
            category="Study",
            labels={"page": study.study.name},
        ),
    log:
        f"{logs}/report.log",
    params:
        code=code,
        configuration=study.configuration_digest,
        study=study.options,
    message:
        "report: the study's page"
    shell:
        f"{run} shukotsu.stages.report {{params.study}} --out {{output:q}} 2> {{log:q}}"


rule subject_pages:  # the report's pages of a subject and of each of its recordings
    input:
        study.poses,
        study.fit_tables,
        study.subject_tables,
        plan=ancient(f"{subject}/plan.json"),
    output:
        directory(f"{results}/report/sub-{{subject}}"),
    log:
        f"{logs}/subject_pages/sub-{{subject}}.log",
    resources:
        **study.resources(2, 15),
    params:
        code=code,
        plan=study.plan,
        language=study.study.language,
    message:
        "subject_pages: subject {wildcards.subject}"
    shell:
        f"{run} shukotsu.stages.report.subject --record-failure --plan {{input.plan:q}} --out {{output:q}}"
        " --language {params.language} 2> {log:q}"


rule print_figures:  # the study's figures for print; each is written, if only to say what it lacks
    input:
        study.exports,  # what could not be made is read with the study's results
        study.subject_pages,
        study.study_tables,
        study.model_comparisons,
        study.movement_comparisons,
        configuration=ancient(study.configuration),
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
        f"{logs}/print_figures.log",
    params:
        code=code,
        configuration=study.configuration_digest,
        study=study.options,
    message:
        "print_figures: the study's figures for print"
    shell:
        f"{run} shukotsu.stages.report.print_figures --record-failure {{params.study}}"
        f" --out {quote(results)}/figures 2> {{log:q}}"
