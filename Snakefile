# From recordings to a report, with a rule for each section of the paper. Rules connect files to stages and contain
# no logic. {params.stages} expands to Python and the folder of the stages' scripts, {params.arguments} to the named
# inputs and outputs of a rule as options of its stage. shukotsu/workflow/study_rules.py gives every rule a log, a
# message and the params whose change makes it run again.

import sys
from pathlib import Path

top = Path(workflow.snakefile).resolve().parent
if (top / "shukotsu").is_dir():  # in a checkout, import its package
    sys.path.insert(0, str(top))

from shukotsu.study.results import FIT_TABLES, MEASURED_TABLES, SKELETON_TABLES
from shukotsu.workflow import study_rules

study = study_rules.begin(workflow, config, top)
results = study.results.folder.as_posix()
subject = f"{results}/sub-{{subject}}"
fit = f"{subject}/fits/{{hand}}/{{model}}"
both_fits = [fit.replace("{hand}", hand) for hand in ("right", "left")]


ruleorder: fit_hands > fit_hand


report: f"{study_rules.CAPTIONS}/workflow.rst"  # the first page of `snakemake --report`


container: "shukotsu.sif"  # from container/Dockerfile, for a whole run (docs/studies.md); no job needs it


rule all:
    input:
        study.outputs,


rule plan:  # what the stages need to know of the study about a subject
    output:
        f"{subject}/plan.json",
    params:  # a function of `output` does not trigger a rerun; changed plans are rewritten when a run starts
        options=lambda wildcards, output: f"{study.options} {study.subject_options(wildcards)}",
    shell:
        "{params.stages}/plan.py {params.options} --out {output} 2> {log}"


rule simulate:  # only for a study with `simulation`: recordings with their truth
    output:
        study.simulated_truth,
        out=study.simulated,
    params:
        subject=study.subject_options,
        seed=study.seed,
    shell:
        "{params.stages}/simulate.py {params.subject} --hand {wildcards.hand} --task {wildcards.task:q} --seed {params.seed} {params.arguments} 2> {log}"


rule stream:  # simulated recordings -> raw captures, as a tracker would send them
    input:
        recording=study.simulated,
        layout=ancient(study.layout),
    output:
        out=study.streamed,
    params:
        layout=study.layout_digest,
    shell:
        "{params.stages}/stream.py {params.arguments} 2> {log}"


rule capture:  # section 2: a recording -> its poses
    input:
        study.simulated_recording,
        ancient(study.recording_files),
    output:
        f"{subject}/{{hand}}/{{recording}}/poses.parquet",
    resources:
        **study.resources(1, 10),
    params:
        layout=study.layout_digest,
        options=study.import_options,
        files=study.recording_digest,
    shell:
        "{params.stages}/capture.py --record-failure {params.options} --out {output} > /dev/null 2> {log}"


rule check_recordings:  # not in the paper: check what was declared against the poses
    input:
        **study.inputs("plan", "poses"),
    output:
        out=f"{subject}/findings.parquet",
    resources:
        **study.resources(1, 5, 2200),
    params:
        plan=study.recordings_plan,
    shell:
        "{params.stages}/check_recordings.py --record-failure {params.arguments} > /dev/null 2> {log}"


rule align_events:  # not in the paper: notes, markers and pulses on each recording's clock
    input:
        ancient(study.event_files),
        **study.inputs("plan", "poses"),
    output:
        out=f"{subject}/events.parquet",
        out_clocks=f"{subject}/clocks.parquet",
    resources:
        **study.resources(1, 2),
    params:
        files=study.event_digest,
        plan=study.recordings_plan,
    shell:
        "{params.stages}/align_events.py --record-failure {params.arguments} 2> {log}"


rule solve_joints:  # section 4, Eq. 1-7: poses -> joint centres and axes
    input:
        **study.inputs("plan", "poses", "findings"),
    output:
        out=f"{subject}/joint_solutions.parquet",
    resources:
        **study.resources(1, 5),
    shell:
        "{params.stages}/solve_joints.py --record-failure {params.arguments} 2> {log}"


rule project_planes:  # end of section 4: the plane that cuts each axis; manual corrections
    input:
        **study.inputs("plan", "findings", "joint_solutions"),
    output:
        out=f"{subject}/projected_joints.parquet",
    shell:
        "{params.stages}/project_planes.py --record-failure {params.arguments} 2> {log}"


rule fit_hand:  # not in the paper: fit a whole hand at once, and pose its recordings
    input:
        **study.inputs("plan", "findings"),
        poses=study.poses_of_fit,
    output:
        [f"{fit}/{table}.parquet" for table in FIT_TABLES],
    resources:
        **study.resources(3, 30),
    params:
        plan=study.fit_plan,
        model=study.model,
        hands=["--hand={hand}", f"--out={fit}"],
    shell:
        "{params.stages}/fit_hand.py --record-failure {params.arguments} --model {params.model:q} {params.hands:q} 2> {log}"


use rule fit_hand as fit_hands with:  # both hands of a person in one job
    output:
        [f"{fit}/{table}.parquet" for fit in both_fits for table in FIT_TABLES],
    wildcard_constraints:
        **study.fitted_together,
    params:
        plan=study.fit_plan,
        model=study.model,
        hands=["--hand=right", f"--out={both_fits[0]}", f"--out-other={both_fits[1]}"],


rule estimate_metacarpals:  # section 5, Eq. 8-11: wrist point, bone lengths, metacarpal postures
    input:
        **study.inputs("plan", "poses", "findings", "projected_joints"),
        **study.fits("fitted_joints", "fitted_bones", "bone_poses"),
    output:
        out_joints=f"{subject}/joint_centres.parquet",
        out_bones=f"{subject}/bone_lengths.parquet",
        out=f"{subject}/metacarpals.parquet",
    resources:
        **study.resources(1, 10),
    shell:
        "{params.stages}/estimate_metacarpals.py --record-failure {params.arguments} 2> {log}"


rule evaluate_tips:  # section 6: replay and tip errors
    input:
        **study.inputs("plan", "poses", "findings", *SKELETON_TABLES),
    output:
        out=f"{subject}/tips.parquet",
        out_errors=f"{subject}/tip_errors.parquet",
    resources:
        **study.resources(1, 10),
    shell:
        "{params.stages}/evaluate_tips.py --record-failure {params.arguments} 2> {log}"


rule evaluate_skeletons:  # not in the paper: score all models of a hand on held-out data
    input:
        study.truth,
        **study.inputs(
            "plan", "poses", "findings", *SKELETON_TABLES, "tips", "tip_errors"
        ),
        **study.fits(
            "posed_tips",
            "bone_poses",
            "fitted_joints",
            "fitted_bones",
            references=True,
        ),
    output:
        out=f"{subject}/skeleton_scores.parquet",
        out_joints=f"{subject}/joint_errors.parquet",
    resources:
        **study.resources(2, 10, 2200),
    shell:
        "{params.stages}/evaluate_skeletons.py --record-failure {params.arguments} 2> {log}"


rule measure_movement:  # not in the paper: ranges, speeds, cycles, paths of the fingertips, strokes at events
    input:
        **study.inputs(
            "plan", "poses", "findings", *SKELETON_TABLES, "events", "clocks"
        ),
        **study.fits("joint_angles", "posed_tips", "bone_poses", "moved_receivers"),
    output:
        [f"{subject}/{table}.parquet" for table in MEASURED_TABLES],
    resources:
        **study.resources(1, 20),
    params:
        out=f"--out={subject}",
    shell:
        "{params.stages}/measure_movement.py --record-failure {params.arguments} {params.out:q} 2> {log}"


rule gather:  # the study's short tables, and what went wrong
    input:
        study.tables,
        plans=ancient(study.plans),
        configuration=ancient(study.configuration),
    output:
        study.study_tables,
        f"{results}/resolved.yaml",
    shell:
        "{params.stages}/gather.py {params.study} 2> {log}"


rule compare_models:  # not in the paper: differences between skeleton models over the subjects
    input:
        study.study_tables,
        configuration=ancient(study.configuration),
    output:
        study.model_comparisons,
    shell:
        "{params.stages}/compare_models.py {params.study} 2> {log}"


rule compare_movement:  # not in the paper: differences between groups, sessions and tasks; repeatability
    input:
        study.study_tables,
        configuration=ancient(study.configuration),
    output:
        study.movement_comparisons,
    shell:
        "{params.stages}/compare_movement.py {params.study} 2> {log}"


rule export:  # skeletons and their motion for other programs
    input:
        **study.inputs("plan", "poses", "findings", *SKELETON_TABLES),
        **study.fits("joint_angles", "posed_tips", "bone_poses", "moved_receivers"),
    output:
        out=directory(f"{subject}/exports"),
    resources:
        **study.resources(1, 60, 2000),
    params:
        formats=",".join(study.export_formats),
        options=study.export_options,
    shell:
        "{params.stages}/export.py --record-failure {params.arguments} --formats {params.formats} {params.options} > /dev/null 2> {log}"


rule export_dataset:  # all recordings as one Motion-BIDS dataset
    input:
        study.exported,
        plans=ancient(study.plans),
        configuration=ancient(study.configuration),
    output:
        directory(f"{results}/dataset"),
    params:
        options=study.export_options,
        participants=study.participants,
    shell:
        "{params.stages}/export.py --record-failure --plan {input.plans} --formats bids {params.options} {params.participants}"
        " --out {output} > /dev/null 2> {log}"


rule export_tables:  # the study's tables for R and others, with a data dictionary
    input:
        tables=study.whole_tables,
    output:
        out=directory(f"{results}/tidy"),
    params:
        name=study.study.name,
    shell:
        "{params.stages}/export_tables.py {params.arguments} --study {params.name:q} 2> {log}"


rule collect_exports:  # exports of all subjects in one folder, as hard links to save space
    input:
        folders=study.export_folders,
    output:
        out=directory(f"{results}/exports"),
    shell:
        "{params.stages}/collect_exports.py {params.arguments} 2> {log}"


rule report:  # the study's page, which also lists other pages that could not be made
    input:
        study.tables,
        study.exports,
        study.subject_pages,
        study.whole_tables,
        configuration=ancient(study.configuration),
    output:
        study_rules.report_page(study),
    shell:
        "{params.stages}/report.py {params.study} --out {output} 2> {log}"


rule subject_pages:  # the report's pages of a subject and of each of its recordings
    input:
        study.subject_tables,
        **study.inputs("plan", "poses"),
    output:
        directory(f"{results}/report/sub-{{subject}}"),
    resources:
        **study.resources(2, 15),
    params:
        language=study.study.language,
    shell:
        "{params.stages}/subject_pages.py --record-failure --plan {input.plan} --out {output} --language {params.language} 2> {log}"


rule print_figures:  # the study's figures for print; without data, a figure states what is missing
    input:
        study.exports,  # reading the study's results includes the failures of exports and pages
        study.subject_pages,
        study.whole_tables,
        configuration=ancient(study.configuration),
    output:
        study_rules.report_figures(study),
    params:
        out=f"--out={results}/figures",
    shell:
        "{params.stages}/print_figures.py --record-failure {params.study} {params.out:q} 2> {log}"


study_rules.complete(workflow, study, workflow.snakefile)
