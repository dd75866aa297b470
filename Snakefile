# From recordings to a report, one rule a section of the paper. Rules wire files to stages and hold no logic.

import os
import sys
from pathlib import Path
from shlex import quote

os.environ["PYTHONSAFEPATH"] = (
    "1"  # no job imports what lies in the folder that it runs in
)
sys.path.insert(0, workflow.basedir)

from schemas.errors import InputError
from schemas.results import FIT_TABLES, MEASURED_TABLES, PRIOR_TABLES
from workflow import one_run, warm_process
from workflow.code_digest import code_digest, write_cache
from workflow.study_files import StudyFiles

try:
    study = StudyFiles.of(
        workflow.configfiles, config, Path(workflow.basedir, "config", "demo.yaml")
    )
    if workflow.is_main_process:
        notes = [row.message for row in study.study.unusable]
        for note in [*notes, *one_run.begin(study.results.folder, sys.argv[1:])]:
            print(f"note: {note}", file=sys.stderr)
except InputError as error:
    print(f"error: {error}", file=sys.stderr)
    sys.exit(2)

results = study.results.folder.as_posix()
subject = f"{results}/sub-{{subject}}"
fit = f"{subject}/fits/{{hand}}/{{model}}"
logs = f"{results}/logs"
run = f"{quote(sys.executable)} -m workflow.job"


report: "captions/workflow.rst"  # the first page of `snakemake --report`


shell.prefix(
    f"export PYTHONPATH={quote(str(workflow.basedir))} PYTHONSAFEPATH=1 OMP_NUM_THREADS=1; "
)


onstart:
    write_cache()
    warm_process.start()


onsuccess:
    gone = one_run.gone(job.output for job in workflow.dag.finished_jobs)
    if gone:
        print(f"error: {gone}", file=sys.stderr)
        sys.exit(1)


onerror:
    gone = one_run.gone(job.output for job in workflow.dag.finished_jobs)
    if gone:
        print(f"error: {gone}", file=sys.stderr)


wildcard_constraints:
    subject="[^/]+",
    hand="right|left",
    task="[^/]+",
    recording="[^/]+",
    model="[^/]+",


rule all:
    input:
        f"{results}/report.html",
        f"{results}/resolved.yaml",
        study.study_tables,
        study.comparison_tables,
        study.all_plans,
        study.tables,
        study.subject_pages,
        study.figures,
        study.exports,
        study.export_folders,


rule plan:  # what the stages need to know of the study about a subject
    output:
        f"{subject}/plan.json",
    log:
        f"{logs}/plan/sub-{{subject}}.log",
    params:
        code=code_digest("workflow.write_plan"),
        plan=study.plan,
        study=study.file,
        results=results,
        subject=study.subject_options,
    message:
        "plan: subject {wildcards.subject}"
    shell:
        f"{run} workflow.write_plan --study {{params.study:q}} --results {{params.results:q}}"
        " {params.subject} --out {output:q} 2> {log:q}"


rule simulate:  # only for a study with `simulation`: recordings, and the truth beside them
    output:
        recording=study.simulated,
        truth=study.simulated_truth,
    log:
        f"{logs}/simulate/sub-{{subject}}_hand-{{hand}}_task-{{task}}.log",
    params:
        code=code_digest("stages.simulate"),
        subject=study.subject_options,
        seed=study.seed,
    message:
        "simulate: subject {wildcards.subject}, {wildcards.hand} hand, {wildcards.task}"
    shell:
        f"{run} stages.simulate {{params.subject}} --hand {{wildcards.hand}}"
        " --task {wildcards.task:q} --seed {params.seed} --out {output.recording:q} 2> {log:q}"


rule stream:  # the simulated tracker's end of the line: recordings -> raw captures
    input:
        recording=study.simulated,
        layout=study.layout,
    output:
        study.streamed,
    log:
        f"{logs}/stream/sub-{{subject}}_hand-{{hand}}_task-{{task}}.log",
    params:
        code=code_digest("stages.capture.emulate_tracker"),
    message:
        "stream: subject {wildcards.subject}, {wildcards.hand} hand, {wildcards.task}"
    shell:
        f"{run} stages.capture emulate --recording {{input.recording:q}} --layout {{input.layout:q}}"
        " --archive {output:q} 2> {log:q}"


rule capture:  # section 2: a recording -> its poses
    input:
        study.recording_files,
    output:
        f"{subject}/{{hand}}/{{recording}}/poses.parquet",
    log:
        f"{logs}/capture/sub-{{subject}}_hand-{{hand}}_{{recording}}.log",
    params:
        code=code_digest("stages.capture.import_recording"),
        layout=study.layout_digest,
        options=study.import_options,
        undeclared=study.undeclared_files,
    message:
        "capture: subject {wildcards.subject}, {wildcards.hand} hand, {wildcards.recording}"
    shell:
        f"{run} stages.capture import --record-failure {{params.options}} --out {{output:q}}"
        " > /dev/null 2> {log:q}"


rule plan_check:  # the same about its recordings alone, so that a model does not concern what is found in them
    output:
        f"{subject}/plan_of_recordings.json",
    log:
        f"{logs}/plan_check/sub-{{subject}}.log",
    params:
        code=code_digest("workflow.write_plan"),
        plan=study.recordings_plan,
        study=study.file,
        results=results,
        subject=study.subject_options,
    message:
        "plan_check: subject {wildcards.subject}"
    shell:
        f"{run} workflow.write_plan --study {{params.study:q}} --results {{params.results:q}}"
        " {params.subject} --recordings --out {output:q} 2> {log:q}"


rule check_recordings:  # not in the paper: what was declared, against what the poses say
    input:
        study.poses,
        plan=f"{subject}/plan_of_recordings.json",
    output:
        f"{subject}/findings.parquet",
    log:
        f"{logs}/check_recordings/sub-{{subject}}.log",
    params:
        code=code_digest("stages.check_recordings"),
    message:
        "check_recordings: subject {wildcards.subject}"
    shell:
        f"{run} stages.check_recordings --record-failure --plan {{input.plan:q}} --out {{output:q}}"
        " > /dev/null 2> {log:q}"


rule align_events:  # not in the paper: notes, markers and pulses, on each recording's own clock
    input:
        study.poses,
        study.event_files,
        plan=f"{subject}/plan_of_recordings.json",
    output:
        events=f"{subject}/events.parquet",
        clocks=f"{subject}/clocks.parquet",
    log:
        f"{logs}/align_events/sub-{{subject}}.log",
    params:
        code=code_digest("stages.align_events"),
    message:
        "align_events: subject {wildcards.subject}"
    shell:
        f"{run} stages.align_events --record-failure --plan {{input.plan:q}} --out {{output.events:q}}"
        " --out-clocks {output.clocks:q} 2> {log:q}"


rule check_calibration:  # not in the paper: which joints should have moved more
    input:
        study.poses,
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
    output:
        f"{subject}/calibration_advice.parquet",
    log:
        f"{logs}/check_calibration/sub-{{subject}}.log",
    params:
        code=code_digest("stages.solve_joints.check_calibration"),
    message:
        "check_calibration: subject {wildcards.subject}"
    shell:
        f"{run} stages.solve_joints.check_calibration --record-failure --plan {{input.plan:q}}"
        " --out {output:q} > /dev/null 2> {log:q}"


rule solve_joints:  # section 4, Eq. 1-7: poses -> joint centres and axes
    input:
        study.poses,
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
    output:
        f"{subject}/joint_solutions.parquet",
    log:
        f"{logs}/solve_joints/sub-{{subject}}.log",
    params:
        code=code_digest("stages.solve_joints"),
    message:
        "solve_joints: subject {wildcards.subject}"
    shell:
        f"{run} stages.solve_joints --record-failure --plan {{input.plan:q}} --out {{output:q}} 2> {{log:q}}"


rule project_planes:  # end of section 4: the plane that cuts each axis; manual corrections
    input:
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
        joints=f"{subject}/joint_solutions.parquet",
    output:
        f"{subject}/projected_joints.parquet",
    log:
        f"{logs}/project_planes/sub-{{subject}}.log",
    params:
        code=code_digest("stages.project_planes"),
    message:
        "project_planes: subject {wildcards.subject}"
    shell:
        f"{run} stages.project_planes --record-failure --plan {{input.plan:q}}"
        " --joints {input.joints:q} --out {output:q} 2> {log:q}"


rule plan_fit:  # the same about one hand under one model, so that another model does not concern it
    output:
        f"{fit}/plan.json",
    log:
        f"{logs}/plan_fit/sub-{{subject}}_hand-{{hand}}_model-{{model}}.log",
    params:
        code=code_digest("workflow.write_plan"),
        plan=study.fit_plan,
        study=study.file,
        results=results,
        subject=study.subject_options,
        model=study.model,
    message:
        "plan_fit: subject {wildcards.subject}, {wildcards.hand} hand, model {wildcards.model}"
    shell:
        f"{run} workflow.write_plan --study {{params.study:q}} --results {{params.results:q}}"
        " {params.subject} --hand {wildcards.hand} --model {params.model:q}"
        " --out {output:q} 2> {log:q}"


rule fit_hand:  # not in the paper: a whole hand at once, and its recordings posed with it
    input:
        study.poses_of_fit,
        plan=f"{fit}/plan.json",
        findings=f"{subject}/findings.parquet",
    output:
        [f"{fit}/{table}.parquet" for table in FIT_TABLES],
    log:
        f"{logs}/fit_hand/sub-{{subject}}_hand-{{hand}}_model-{{model}}.log",
    params:
        code=code_digest("stages.fit_hand"),
        model=study.model,
        folder=fit,
    message:
        "fit_hand: subject {wildcards.subject}, {wildcards.hand} hand, model {wildcards.model}"
    shell:
        f"{run} stages.fit_hand --record-failure --plan {{input.plan:q}} --hand {{wildcards.hand}}"
        " --model {params.model:q} --out {params.folder:q} 2> {log:q}"


rule fit_prior:  # not in the paper: the hand that anatomy expects, for comparison
    input:
        study.poses,
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
    output:
        [f"{subject}/{table}.parquet" for table in PRIOR_TABLES],
    log:
        f"{logs}/fit_prior/sub-{{subject}}.log",
    params:
        code=code_digest("stages.fit_hand.prior"),
        folder=subject,
    message:
        "fit_prior: subject {wildcards.subject}"
    shell:
        f"{run} stages.fit_hand.prior --record-failure --plan {{input.plan:q}} --out {{params.folder:q}} 2> {{log:q}}"


rule estimate_metacarpals:  # section 5, Eq. 8-11: wrist point, bone lengths, metacarpal postures
    input:
        study.poses,
        study.fits,
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
        joints=f"{subject}/projected_joints.parquet",
    output:
        joints=f"{subject}/joint_centres.parquet",
        bones=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
    log:
        f"{logs}/estimate_metacarpals/sub-{{subject}}.log",
    params:
        code=code_digest("stages.estimate_metacarpals"),
    message:
        "estimate_metacarpals: subject {wildcards.subject}"
    shell:
        f"{run} stages.estimate_metacarpals --record-failure --plan {{input.plan:q}}"
        " --joints {input.joints:q} --out-joints {output.joints:q} --out-bones {output.bones:q}"
        " --out {output.metacarpals:q} 2> {log:q}"


rule evaluate_tips:  # section 6: replay and tip errors
    input:
        study.poses,
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
        joints=f"{subject}/joint_centres.parquet",
        bones=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
    output:
        tips=f"{subject}/tips.parquet",
        errors=f"{subject}/tip_errors.parquet",
    log:
        f"{logs}/evaluate_tips/sub-{{subject}}.log",
    params:
        code=code_digest("stages.evaluate_tips"),
    message:
        "evaluate_tips: subject {wildcards.subject}"
    shell:
        f"{run} stages.evaluate_tips --record-failure --plan {{input.plan:q}} --joints {{input.joints:q}}"
        " --bones {input.bones:q} --metacarpals {input.metacarpals:q} --out {output.tips:q}"
        " --out-errors {output.errors:q} 2> {log:q}"


rule evaluate_skeletons:  # not in the paper: all models of a hand, on data that they have not seen
    input:
        study.poses,
        study.fits,
        study.truth,
        [f"{subject}/{table}.parquet" for table in PRIOR_TABLES],
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
        joints=f"{subject}/joint_centres.parquet",
        bones=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
        tips=f"{subject}/tips.parquet",
        errors=f"{subject}/tip_errors.parquet",
    output:
        scores=f"{subject}/skeleton_scores.parquet",
        errors=f"{subject}/joint_errors.parquet",
    log:
        f"{logs}/evaluate_skeletons/sub-{{subject}}.log",
    params:
        code=code_digest("stages.evaluate_skeletons"),
    message:
        "evaluate_skeletons: subject {wildcards.subject}"
    shell:
        f"{run} stages.evaluate_skeletons --record-failure --plan {{input.plan:q}}"
        " --out {output.scores:q} --out-joints {output.errors:q} 2> {log:q}"


rule measure_movement:  # not in the paper: ranges of motion, speeds, cycles, ways of the fingertips
    input:
        study.poses,
        study.fits,
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
        joints=f"{subject}/joint_centres.parquet",
        bones=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
        events=f"{subject}/events.parquet",
    output:
        [f"{subject}/{table}.parquet" for table in MEASURED_TABLES],
    log:
        f"{logs}/measure_movement/sub-{{subject}}.log",
    params:
        code=code_digest("stages.measure_movement"),
        folder=subject,
    message:
        "measure_movement: subject {wildcards.subject}"
    shell:
        f"{run} stages.measure_movement --record-failure --plan {{input.plan:q}}"
        " --events {input.events:q} --out {params.folder:q} 2> {log:q}"


rule gather:  # the study's short tables, and what went wrong
    input:
        study.gathered,
        poses=study.all_poses,
        plans=study.plans,
        configuration=study.configuration,
    output:
        study.study_tables,
        f"{results}/resolved.yaml",
    log:
        f"{logs}/gather.log",
    params:
        code=code_digest("stages.gather"),
        study=study.file,
        results=results,
    message:
        "gather: the study's tables"
    shell:
        f"{run} stages.gather --study {{params.study:q}} --results {{params.results:q}} 2> {{log:q}}"


rule compare_movement:  # not in the paper: how subjects, sessions and tasks differ, and how well it repeats
    input:
        study.study_tables,
        configuration=study.configuration,
    output:
        study.comparison_tables,
    log:
        f"{logs}/compare_movement.log",
    params:
        code=code_digest("stages.compare_movement"),
        study=study.file,
        results=results,
    message:
        "compare_movement: how subjects, sessions and tasks differ"
    shell:
        f"{run} stages.compare_movement --study {{params.study:q}} --results {{params.results:q}} 2> {{log:q}}"


rule export:  # skeletons and their motion for other programs
    input:
        study.poses,
        study.fits,
        plan=f"{subject}/plan.json",
        findings=f"{subject}/findings.parquet",
        joints=f"{subject}/joint_centres.parquet",
        bones=f"{subject}/bone_lengths.parquet",
        metacarpals=f"{subject}/metacarpals.parquet",
    output:
        directory(f"{subject}/exports"),
    log:
        f"{logs}/export/sub-{{subject}}.log",
    params:
        code=code_digest("stages.export"),
        formats=",".join(study.export_formats),
        options=study.export_options,
    message:
        "export: subject {wildcards.subject}"
    shell:
        f"{run} stages.export --record-failure --plan {{input.plan:q}} --formats {{params.formats}}"
        " {params.options} --out {output:q} > /dev/null 2> {log:q}"


rule export_dataset:  # all recordings as one Motion-BIDS dataset
    input:
        study.exported,
        plans=study.plans,
        configuration=study.configuration,
    output:
        directory(f"{results}/dataset"),
    log:
        f"{logs}/export_dataset.log",
    params:
        code=code_digest("stages.export"),
        options=study.export_options,
        participants=study.participants,
    message:
        "export_dataset: the study as a Motion-BIDS dataset"
    shell:
        f"{run} stages.export --record-failure --plan {{input.plans:q}} --formats bids {{params.options}}"
        " {params.participants} --out {output:q} > /dev/null 2> {log:q}"


rule collect_exports:  # of all subjects in one flat folder, by links: they take no room twice
    input:
        study.export_folders,
    output:
        directory(f"{results}/exports"),
    log:
        f"{logs}/collect_exports.log",
    params:
        code=code_digest("stages.export.collect"),
    message:
        "collect_exports: the exports of all subjects in one folder"
    shell:
        f"{run} stages.export.collect --folders {{input:q}} --out {{output:q}} 2> {{log:q}}"


rule report:  # it names the pages that could not be made
    input:
        study.exports,
        study.subject_pages,
        study.study_tables,
        study.comparison_tables,
        configuration=study.configuration,
    output:
        report(
            f"{results}/report.html",
            caption="captions/report.rst",
            category="Study",
            labels={"page": study.study.name},
        ),
        movement=f"{results}/report/movement.html",
    log:
        f"{logs}/report.log",
    params:
        code=code_digest("stages.report"),
        study=study.file,
        results=results,
    message:
        "report: the study's page"
    shell:
        f"{run} stages.report --study {{params.study:q}} --results {{params.results:q}} --out {{output[0]:q}}"
        " 2> {log:q}"


rule subject_pages:  # the report's pages of a subject and of each of its recordings
    input:
        study.poses,
        study.fits,
        study.subject_tables,
        plan=f"{subject}/plan.json",
    output:
        directory(f"{results}/report/sub-{{subject}}"),
    log:
        f"{logs}/subject_pages/sub-{{subject}}.log",
    params:
        code=code_digest("stages.report.subject"),
        language=study.study.language,
    message:
        "subject_pages: subject {wildcards.subject}"
    shell:
        f"{run} stages.report.subject --record-failure --plan {{input.plan:q}} --out {{output:q}}"
        " --language {params.language} 2> {log:q}"


rule print_figures:  # the study's figures for print; each is written, if only to say what it lacks
    input:
        study.study_tables,
        study.comparison_tables,
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
        f"{logs}/print_figures.log",
    params:
        code=code_digest("stages.report.print_figures"),
        study=study.file,
        results=results,
    message:
        "print_figures: the study's figures for print"
    shell:
        f"{run} stages.report.print_figures --record-failure --study {{params.study:q}}"
        " --results {params.results:q} --out {params.results:q}/figures 2> {log:q}"
