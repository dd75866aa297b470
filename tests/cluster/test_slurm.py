"""A small study run by the profile for Slurm on a real Slurm: the same bytes, from few jobs."""

import importlib.util
import os
import secrets
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
from studies.running import REPOSITORY, StudyRun, hashes, record, write_study

SYSTEM_CONF = Path("/etc/slurm/slurm.conf")
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo")
PLUGIN = "snakemake_executor_plugin_cluster_generic"
DAEMONS = ("slurmd", "slurmctld", "munged")
CPUS = 6
"""Number of CPUs configured for the node, so that a sleeping job does not block others."""
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
PartitionName=all Nodes={host} Default=YES MaxTime=60 State=UP
"""


def missing() -> str:
    """Return why no private Slurm can be started here, or an empty string if it can."""
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


@contextmanager
def private_slurm(folder: Path) -> Iterator[None]:
    """Start munged, slurmctld and slurmd, and stop them and all jobs at the end, also after a failure.

    folder : for all their files; its path must be short enough for a socket's (107 bytes). Raises
    RuntimeError with the end of the logs if the node does not accept jobs within 30 s.
    """
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    key, configuration = folder / "munge.key", folder / "slurm.conf"
    key.write_bytes(secrets.token_bytes(128))
    key.chmod(0o600)
    folder.chmod(0o755)  # munged requires a socket readable by all; only root reads the key
    values = {"host": socket.gethostname().split(".")[0], "folder": folder, "cpus": CPUS}
    values |= {"memory_mb": int(run("slurmd", "-C").split("RealMemory=")[1].split()[0])}
    with socket.socket() as first, socket.socket() as second:
        for name, listener in (("controller_port", first), ("node_port", second)):
            listener.bind(("127.0.0.1", 0))
            values[name] = listener.getsockname()[1]
    configuration.write_text(TEMPLATE.format(**values), "utf-8")
    SYSTEM_CONF.parent.mkdir(parents=True, exist_ok=True)
    SYSTEM_CONF.symlink_to(configuration)
    try:
        files = {"key-file": key.name, "socket": "munge.socket", "pid-file": "munged.pid"}
        files |= {"log-file": "munged.log", "seed-file": "munged.seed"}
        run("munged", *(f"--{word}={folder / name}" for word, name in files.items()))
        run("slurmctld", "-c")
        run("slurmd")
        wait(
            folder, lambda: run("sinfo", "-h", "-o", "%T", check=False).strip() == "idle", "node is not idle"
        )
        yield
    finally:
        texts = [
            (folder / f"{name}.pid").read_text() for name in DAEMONS if (folder / f"{name}.pid").is_file()
        ]
        daemons = [psutil.Process(int(text)) for text in texts if text and psutil.pid_exists(int(text))]
        if daemons:
            run("scancel", "--user=root", check=False)
            wait(folder, lambda: not states("PENDING,RUNNING,COMPLETING"), "jobs do not end")
        for daemon in daemons:
            daemon.terminate()
        for daemon in psutil.wait_procs(daemons, 10.0)[1]:
            daemon.kill()
        SYSTEM_CONF.unlink()


def states(kinds: str = "all") -> list[str]:
    """Return the states of all jobs that are in one of `kinds`, such as COMPLETED or TIMEOUT."""
    return run("squeue", "--noheader", "--format=%T", f"--states={kinds}").split()


def wait(folder: Path, ready: Callable[[], bool], failure: str, seconds: float = 30.0) -> None:
    until = time.monotonic() + seconds
    while not ready():
        if time.monotonic() > until:
            logs = "\n".join(path.read_text("utf-8")[-2000:] for path in folder.glob("*.log"))
            raise RuntimeError(f"private Slurm: {failure} after {seconds:.0f} s\n{logs}")
        time.sleep(0.2)


def run(*words: str, check: bool = True) -> str:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if check and done.returncode:
        raise RuntimeError(f"{' '.join(words)} ended with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


pytestmark = pytest.mark.slurm


def _study(folder: Path) -> StudyRun:
    """Write a study of two subjects' right hands with two short tasks and two models."""
    folder.mkdir(parents=True)
    rows = []
    for subject in ("01", "02"):
        for task, role in (("rom", "calibration"), ("opposition", "evaluation")):
            file = record(folder / f"{subject}-{task}.parquet", subject=subject, task=task)
            rows.append(f"{subject}\tright\t{task}\t{role}\t{file.name}")
    return write_study(folder, "same", rows, ["paper-fig3-rest", "paper-fig4"])


def test_slurm_gives_the_same_results_from_few_jobs(tmp_path: Path) -> None:
    """There is one Slurm job per subject and one for the study, and the results are the same bytes."""
    if reason := missing():
        pytest.skip(reason)
    local, study = _study(tmp_path / "local"), _study(tmp_path / "study")
    local.run()
    profile = ["--workflow-profile", str(REPOSITORY / "profiles" / "slurm")]
    with tempfile.TemporaryDirectory(prefix="slurm-") as name, private_slurm(Path(name)):
        faster = ["--seconds-between-status-checks", "1", "--latency-wait", "15"]
        done = study.snakemake(*profile, *faster, cores=1)
        assert done.returncode == 0, done.stderr
        assert states() == ["COMPLETED"] * 3
    assert hashes(study.results.folder) == hashes(local.results.folder)
