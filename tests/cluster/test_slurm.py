"""A small study through the Slurm profile and a real Slurm: the same bytes, whatever was killed on the way.

What is waited for most is Slurm itself: it looks every 30 s for jobs that are out of time, and a minute is
the least that it gives. That study therefore runs beside the others.
"""

from __future__ import annotations

import importlib.util
import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest
from studies.running import REPOSITORY, StudyRun, hashes, record, write_study

SYSTEM_CONF = Path("/etc/slurm/slurm.conf")
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo")
PLUGIN = "snakemake_executor_plugin_cluster_generic"
STOPPING = ("slurmd", "slurmctld", "munged")
PARTITION = "all"
CPUS = 6
"""What Slurm believes the node has; a job that sleeps must not keep others waiting."""
TEMPLATE = """
ClusterName=private
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=sched_interval=1,sched_min_interval=0,bf_interval=1
MinJobAge=600
KillWait=2
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
DefMemPerCPU=500
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory_mb} State=UNKNOWN
PartitionName={partition} Nodes={host} Default=YES MaxTime=60 State=UP
"""


def missing() -> str:
    """Return why no private Slurm can be started here; empty where it can."""
    if os.geteuid() != 0:
        return "a private Slurm needs root"
    absent = [program for program in PROGRAMS if shutil.which(program) is None]
    if absent:
        return f"a private Slurm needs Debian's slurm-wlm and munge; absent: {', '.join(absent)}"
    if importlib.util.find_spec(PLUGIN) is None:
        return f"needs {PLUGIN}"
    if SYSTEM_CONF.exists() or SYSTEM_CONF.is_symlink():
        return f"this machine has a Slurm of its own: {SYSTEM_CONF}"
    return ""


class PrivateSlurm:
    """The daemons, between `start` and `stop`; all their files are below `folder`.

    folder : short enough for a socket in it (107 bytes with its name), readable by root alone.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.host = socket.gethostname().split(".")[0]

    def start(self) -> None:
        """Start munged, slurmctld and slurmd; return when the node takes jobs.

        Raises RuntimeError, with the end of the logs, where it does not within 30 s.
        """
        for name in ("state", "spool"):
            (self.folder / name).mkdir(parents=True)
        self._write_configuration()
        self._start_munge()
        _run("slurmctld", "-c")
        _run("slurmd")
        self._wait(self._idle, "the node is not idle")

    def stop(self) -> None:
        """End every job and daemon that `start` started, and remove the link; do it after any failure too."""
        if self._pid("slurmctld"):
            subprocess.run(["scancel", "--user=root"], check=False, capture_output=True)
            self._wait(lambda: not self.jobs(), "jobs do not end")
        for daemon in STOPPING:
            self._end(daemon)
        if SYSTEM_CONF.is_symlink() and SYSTEM_CONF.readlink() == self._conf:
            SYSTEM_CONF.unlink()

    def jobs(self, states: str = "PENDING,RUNNING,COMPLETING", folder: Path | None = None) -> list[str]:
        """Return the numbers of the jobs that are in one of the states, submitted from the folder."""
        return list(self.states(folder, states))

    def states(self, folder: Path | None = None, states: str = "all") -> dict[str, str]:
        """Return the state, such as COMPLETED or TIMEOUT, of every such job by its number."""
        listed = _run("squeue", "--noheader", "--format=%i|%T|%Z", f"--states={states}").splitlines()
        rows = [line.split("|", 2) for line in listed]
        return {job: state for job, state, origin in rows if folder is None or Path(origin) == folder}

    @property
    def _conf(self) -> Path:
        return self.folder / "slurm.conf"

    def _write_configuration(self) -> None:
        controller_port, node_port = _free_ports(2)
        self._conf.write_text(
            TEMPLATE.format(
                host=self.host,
                folder=self.folder,
                controller_port=controller_port,
                node_port=node_port,
                cpus=CPUS,
                memory_mb=_memory_mb(),
                partition=PARTITION,
            ),
            "utf-8",
        )
        SYSTEM_CONF.parent.mkdir(parents=True, exist_ok=True)
        SYSTEM_CONF.symlink_to(self._conf)

    def _start_munge(self) -> None:
        key = self.folder / "munge.key"
        key.write_bytes(secrets.token_bytes(128))
        key.chmod(0o600)
        self.folder.chmod(0o755)  # munged wants its socket within everyone's reach; the key stays root's
        files = {"key-file": key.name, "socket": "munge.socket", "pid-file": "munged.pid"}
        files |= {"log-file": "munged.log", "seed-file": "munged.seed"}
        _run("munged", *(f"--{word}={self.folder / name}" for word, name in files.items()))

    def _idle(self) -> bool:
        done = subprocess.run(["sinfo", "-h", "-o", "%T"], capture_output=True, text=True, check=False)
        return done.stdout.strip() == "idle"

    def _wait(self, ready: Callable[[], bool], failure: str, seconds: float = 30.0) -> None:
        until = time.monotonic() + seconds
        while not ready():
            if time.monotonic() > until:
                logs = "\n".join(path.read_text("utf-8")[-2000:] for path in self.folder.glob("*.log"))
                raise RuntimeError(f"private Slurm: {failure} after {seconds:.0f} s\n{logs}")
            time.sleep(0.2)

    def _pid(self, daemon: str) -> int:
        """Process number of a daemon of ours that lives; 0 for none."""
        try:
            pid = int((self.folder / f"{daemon}.pid").read_text())
            os.kill(pid, 0)
        except (FileNotFoundError, ProcessLookupError, ValueError):
            return 0
        return pid

    def _end(self, daemon: str) -> None:
        pid = self._pid(daemon)
        if not pid:
            return
        os.kill(pid, signal.SIGTERM)
        until = time.monotonic() + 10.0
        while Path("/proc", str(pid)).exists():
            if time.monotonic() > until:
                os.kill(pid, signal.SIGKILL)
            time.sleep(0.1)


def _run(*words: str) -> str:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} ended with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def _memory_mb() -> int:
    """Memory that Slurm finds in this machine."""
    return int(_run("slurmd", "-C").split("RealMemory=")[1].split()[0])


def _free_ports(count: int) -> list[int]:
    """Ports that nothing listens on now, all different."""
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


pytestmark = pytest.mark.slurm

Done = subprocess.CompletedProcess[str]
SNAKEFILE = REPOSITORY / "Snakefile"
PROFILE = ["--workflow-profile", str(REPOSITORY / "config" / "profiles" / "slurm")]
FASTER = ["--seconds-between-status-checks", "1", "--latency-wait", "15"]
ASKING = re.findall(r"^rule (\w+):(?:(?!^rule ).)*?resources:", SNAKEFILE.read_text("utf-8"), re.M | re.S)
"""Rules that say themselves how long they take."""
ONE_MINUTE = ["--default-resources", "mem_mb=500", "runtime=0"]
ONE_MINUTE += ["--set-resources", "subject_pages:runtime=1", "gather:runtime=5"]
ONE_MINUTE += [f"{rule}:runtime=0" for rule in ASKING if rule != "subject_pages"]
SLOW = (
    'case "$BASH_EXECUTION_STRING" in *stages.solve_joints\\ *) [ ! -f slow ] || sleep "$(cat slow)";; esac\n'
)
"""Read by every bash that runs a job: solve_joints waits the seconds in the study's file `slow`."""


@pytest.fixture(scope="module")
def slurm() -> Iterator[PrivateSlurm]:
    """Run a Slurm of this module's own, stopped whatever happens."""
    if reason := missing():
        pytest.skip(reason)
    with tempfile.TemporaryDirectory(prefix="slurm-") as name, pytest.MonkeyPatch.context() as patch:
        slowing = Path(name, "slowing.sh")
        slowing.write_text(SLOW, "utf-8")
        patch.setenv("BASH_ENV", str(slowing))
        private = PrivateSlurm(Path(name))
        try:
            private.start()
            yield private
        finally:
            private.stop()


@pytest.fixture(scope="module")
def out_of_time(
    slurm: PrivateSlurm, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Future[tuple[StudyRun, Done, Done]]]:
    """Start, in a thread, a study that is given a minute, which is too little, and then more."""
    study = _study(tmp_path_factory.mktemp("time") / "study", subjects=["01"], models=["paper-fig4"])

    def work() -> tuple[StudyRun, Done, Done]:
        (study.folder / "slow").write_text("300")
        cut_off = _through_slurm(study, *ONE_MINUTE)
        (study.folder / "slow").write_text("62")
        return study, cut_off, _through_slurm(study)

    with ThreadPoolExecutor(1) as pool:
        yield pool.submit(work)
    assert slurm.jobs() == []


@pytest.fixture(scope="module")
def local(out_of_time: object, tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """The study as it is on a laptop."""
    del out_of_time  # has begun by now
    study = _study(tmp_path_factory.mktemp("local") / "study")
    study.run()
    return study


def test_results_are_those_of_a_laptop_from_few_jobs(
    slurm: PrivateSlurm, local: StudyRun, tmp_path: Path
) -> None:
    """One Slurm job a subject and one for the study, and every byte the same."""
    study = _study(tmp_path / "study")
    done = _through_slurm(study)
    assert done.returncode == 0, done.stderr
    assert _states(slurm, study) == ["COMPLETED"] * 3
    assert hashes(study.results.folder) == hashes(local.results.folder)


def test_a_job_out_of_time_is_reported_and_finishes_with_more(
    slurm: PrivateSlurm, out_of_time: Future[tuple[StudyRun, Done, Done]]
) -> None:
    """The failure names the job and the stage's log; the same with the profile's own minutes ends well."""
    study, cut_off, finished = out_of_time.result()
    (killed,) = slurm.jobs("TIMEOUT", study.folder)
    assert cut_off.returncode == 1
    assert f"Slurm job {killed}: TIMEOUT (log: .snakemake/slurm/{killed}.log)" in cut_off.stderr
    assert "logs/solve_joints/sub-01.log" in cut_off.stderr
    assert "DUE TO TIME LIMIT" in _slurm_log(study, killed)
    assert finished.returncode == 0, finished.stderr
    assert sorted(_states(slurm, study)) == ["COMPLETED", "COMPLETED", "TIMEOUT"]


def _study(folder: Path, subjects: list[str] | None = None, models: list[str] | None = None) -> StudyRun:
    """Two subjects' right hands, a second of each of two tasks, and two models, unless less is asked for."""
    folder.mkdir(parents=True)
    rows = []
    for subject in subjects or ["01", "02"]:
        for task, role in (("rom", "calibration"), ("opposition", "evaluation")):
            file = record(folder / f"{subject}-{task}.parquet", subject=subject, task=task)
            rows.append(f"{subject}\tright\t{task}\t{role}\t{file.name}")
    return write_study(folder, "same", rows, models or ["paper-fig3-rest", "paper-fig4"])


def _through_slurm(study: StudyRun, *words: str) -> Done:
    return study.snakemake(*PROFILE, *FASTER, *words, cores=1)


def _states(slurm: PrivateSlurm, study: StudyRun) -> list[str]:
    return list(slurm.states(study.folder).values())


def _slurm_log(study: StudyRun, job: str) -> str:
    return (study.folder / ".snakemake" / "slurm" / f"{job}.log").read_text("utf-8")
