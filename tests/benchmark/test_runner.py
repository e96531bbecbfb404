"""Suites: what is refused, that numbers do not depend on how they were run, and that nothing is lost or repeated."""

from __future__ import annotations

import re
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from sledenv.benchmark import runner
from sledenv.benchmark.problem import TRIALS, Problem
from sledenv.benchmark.results import COLUMNS, FILE, Results, read_results
from sledenv.benchmark.runner import run_suite
from sledenv.benchmark.runs import meant, train
from sledenv.benchmark.suite import Suite, SuiteError
from tests.own_scenarios import own_scenario

ROOT = Path(__file__).parents[2]
TIMES = ["train_seconds", "train_cpu_seconds"]
SUITE = {
    "id": "tiny",
    "title": "A test",
    "contexts": 2,
    "settings": str(ROOT / "configs" / "agents"),
    "steps": 240,
    "scenarios": [own_scenario("boulders"), own_scenario("spinning_entry")],
    "agents": {"launch": {"sledenv.agents.zero": 1, "sledenv.agents.random_launch": 2, "sledenv.agents.best_fixed": 2}},
}


def written(folder: Path, **changes: object) -> Path:
    """File of a suite with some keys changed; None removes a key."""
    content = {key: value for key, value in (SUITE | changes).items() if value is not None}
    path = folder / "tiny.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def run(file: Path, folder: Path, **how: object) -> Results:
    """All that a finished suite has found, without what was timed."""
    suite = Suite.load(file)
    found = read_results(suite, run_suite(suite, folder, **how))
    return found._replace(runs=found.runs.drop(columns=TIMES))


def same(one: Results, other: Results) -> None:
    for mine, theirs in zip(one, other, strict=True):
        pd.testing.assert_frame_equal(mine, theirs, check_exact=True)


def done(folder: Path) -> set[str]:
    """Keys of the jobs whose results are there."""
    try:
        with sqlite3.connect(f"file:{folder / FILE}?mode=ro", uri=True, timeout=60.0) as connection:
            return {key for (key,) in connection.execute("SELECT key FROM runs")}
    except sqlite3.OperationalError:  # not yet
        return set()


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Results]:
    """A suite that was run by one worker without interruption: its file, its folder, its tables."""
    home = tmp_path_factory.mktemp("suite")
    file = written(home)
    return file, home / "out", run(file, home / "out", workers=1)


def test_a_suite_judges_every_agent_on_every_scenario(finished):
    """Oracle: counting; rewards are those of the simulator."""
    _, folder, found = finished
    judged = found.judged
    assert len(judged) == 2 * (1 + 2 + 2) * 2  # scenarios, seeds, contexts
    assert len(found.runs) == 10
    assert found.runs.groupby("agent")["descents"].max().to_dict() == {"best_fixed": 240, "random_launch": 0, "zero": 0}
    problem = Problem(own_scenario("boulders"))
    chosen = judged.query("scenario == 'boulders' and agent == 'best_fixed' and seed == 1")
    trials = problem.trials(problem.contexts("test", 2), "test")
    again = problem.descend(trials.reshape(-1, 14), chosen[["action_0"]].to_numpy().repeat(TRIALS, axis=0))
    assert np.array_equal(again.jam.reward.reshape(2, -1).mean(axis=1), chosen["reward"])
    assert np.array_equal(again.outcomes["sliding"].reshape(2, -1).mean(axis=1), chosen["loss_sliding"])
    assert judged[["action_1", "action_2"]].isna().all(axis=None)
    assert not list(folder.rglob("*.part"))


def test_the_columns_that_are_written_are_those_that_are_told(finished):
    """Oracle: the table in docs/benchmark.md."""
    page = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    rows = page.partition("### Columns of the tables")[2].partition("\n#")[0].split("\n")
    told = {name: set() for name in COLUMNS}
    for tables_of, columns in (row.split("|")[1:3] for row in rows if row.startswith("|")):
        for name in told if " all" in tables_of else re.findall(r"`(\w+)`", tables_of):
            told[name] |= set(re.findall(r"`(\w+)`", columns))
    for name, table in finished[2]._asdict().items():
        assert set(table) | {"key"} | (set(TIMES) if name == "runs" else set()) == told[name]


def test_the_numbers_do_not_depend_on_the_number_of_workers(finished, tmp_path):
    """Oracle: one worker against two."""
    file, _, found = finished
    same(run(file, tmp_path / "out", workers=2), found)


def test_what_was_deleted_is_built_again_and_nothing_else(finished, monkeypatch):
    """Oracle: the tables as they were; only the deleted job and run are trained or judged again."""
    file, folder, found = finished
    trained, judged = [], []
    monkeypatch.setattr(runner, "train", lambda *given: trained.append(given) or train(*given))
    monkeypatch.setattr(
        runner, "runner", lambda *_: lambda calls: (judged.append(one) or one(*its) for one, its in calls)
    )
    same(run(file, folder), found)
    assert not judged
    with sqlite3.connect(folder / FILE) as connection:
        for name in COLUMNS:
            connection.execute(f"DELETE FROM {name} WHERE agent = 'best_fixed' AND scenario = 'boulders'")
    config = folder / "trained" / "launch-boulders-best_fixed-s1" / "config.yaml"
    config.write_text(config.read_text().replace("n_timesteps: 240", "n_timesteps: 241"))
    same(run(file, folder), found)
    assert len(judged) == 2
    assert [(given[0], given[3]) for given in trained] == [("sledenv.agents.best_fixed", 1)]


def test_jobs_that_mean_something_else_take_the_place_of_those_that_were(finished, tmp_path):
    """Oracle: the tables as they were, after a suite of three contexts and one of an agent less in the same folder."""
    file, folder, found = finished
    fewer = run(written(tmp_path, agents={"launch": {"sledenv.agents.zero": 1}}), folder, workers=1)
    same(fewer, Results(*(table[table["agent"] == "zero"].reset_index(drop=True) for table in found)))
    more = run(written(tmp_path, contexts=3), folder, workers=1)
    assert len(more.judged) == len(found.judged) // 2 * 3
    assert more.judged.groupby("agent")["context"].nunique().eq(3).all()
    same(run(file, folder, workers=1), found)


def test_a_file_of_results_that_is_none_is_named(finished, tmp_path):
    suite = Suite.load(finished[0])
    with pytest.raises(FileNotFoundError, match=r"it has no results\.sqlite"):
        read_results(suite, tmp_path)
    (tmp_path / FILE).write_text("no database" * 100)
    for reading in (read_results, run_suite):
        with pytest.raises(OSError, match=r"results\.sqlite: .*file is not a database; without this file"):
            reading(suite, tmp_path)


def test_a_suite_that_is_killed_goes_on_where_it_was(finished, tmp_path, monkeypatch):
    """Oracle: the tables of the run that was not interrupted; what had been judged is not judged again."""
    file, _, found = finished
    folder = tmp_path / "out"
    script = (
        "import sys; from pathlib import Path\n"
        "from sledenv.benchmark.runner import run_suite\n"
        "from sledenv.benchmark.suite import Suite\n"
        "if __name__ == '__main__':\n"
        "    file = Path(sys.argv[1]); run_suite(Suite.load(file), Path(sys.argv[2]), workers=1)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script, file, folder], cwd=ROOT, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 240.0
    while len(done(folder)) < 3:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    process.wait()
    before, called = done(folder), []
    assert 3 <= len(before) < len(found.runs)
    monkeypatch.setattr(
        runner, "runner", lambda *_: lambda calls: (called.append(1) or one(*its) for one, its in calls)
    )
    same(run(file, folder), found)
    assert len(called) == len(found.runs) - len(before)
    assert before < done(folder)


def test_a_job_that_fails_leaves_the_results_of_others(finished, tmp_path, monkeypatch):
    """Oracle: the tables of the run without an error, after one while the rows of the fourth job are written."""
    file, _, found = finished
    real = runner._train_and_judge

    def failing(calls):
        for i, (_, given) in enumerate(calls):
            name, tables = real(*given)
            if i == 3:
                yield name, tables | {"runs": tables["runs"].assign(suite=[{}])}  # nothing that SQLite can hold
            yield name, tables

    with monkeypatch.context() as patch:
        patch.setattr(runner, "runner", lambda *_: failing)
        with pytest.raises(OSError, match=FILE):
            run(file, tmp_path / "out")
    assert len(done(tmp_path / "out")) == 3
    same(run(file, tmp_path / "out", workers=1), found)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contexts": 1}, "contexts = 1: must be a whole number in [2, 100000]"),
        ({"contexts": None}, "contexts: missing"),
        ({"scenarios": ["sled_snwo"]}, "did you mean 'sled_snow'"),
        ({"scenarios": [own_scenario("ice_drop"), own_scenario("ice_drop")]}, "must not repeat a scenario"),
        ({"agents": {"flight": {"sledenv.agents.zero": 1}}}, "'launch' or 'descent'"),
        ({"agents": {"launch": {"sledenv.agents.zero": 0}}}, "zero.seeds = 0: must be a whole number in [1, 1000]"),
        ({"agents": {}}, "agents: must have at least 1 entry"),
        ({"agents": {"launch": {"sledenv.agents.sac": 1, "mine.sac": 1}}}, "must not have two agents called 'sac'"),
        ({"agents": {"launch": {"sledenv.agents.zero": {"seeds": 1, "varaints": {}}}}}, "did you mean 'variants'?"),
        ({"observe": ["frictoin"]}, "must be 'all' or list fields of the context"),
        ({"seeds": 3}, "seeds = 3: unknown key (did you mean 'steps'?); known: id, title"),
        ({"agents": {"launch": {"sledenv.agents.zorro": 1}}}, "there is no such module"),
        ({"agents": {"launch": {"sledenv.agents.train": 1}}}, "no class Agent"),
        ({"settings": "../agents"}, "/agents': there is no such folder"),
        ({"settings": "."}, "best_fixed.yaml: missing, but agent sledenv.agents.best_fixed needs settings: copy"),
    ],
)
def test_a_wrong_suite_is_refused_by_name_of_the_key_before_anything_is_written(changes, message, tmp_path):
    with pytest.raises(SuiteError) as error:
        run_suite(Suite.load(written(tmp_path, **changes)), tmp_path / "out")
    assert message in str(error.value)
    assert not (tmp_path / "out").exists()


def test_an_agent_has_variants_with_settings_of_their_own(tmp_path):
    """Each is a job with a name of its own; a setting that the agent does not have is refused."""
    few = {"seeds": 2, "variants": {"few": {"contexts": 10}, "many": {}}}
    suite = Suite.load(written(tmp_path, agents={"launch": {"sledenv.agents.best_fixed": few}}, steps=None))
    jobs = [job for job in suite.jobs() if job.scenario == own_scenario("boulders")]
    assert [(job.agent, job.seed, job.settings["contexts"]) for job in jobs] == [
        ("best_fixed-few", 0, 10),
        ("best_fixed-many", 0, 100),
        ("best_fixed-few", 1, 10),
        ("best_fixed-many", 1, 100),
    ]
    assert jobs[0].name == "launch-boulders-best_fixed-few-s0"
    few["variants"]["few"] = {"context": 10}
    suite = Suite.load(written(tmp_path, agents={"launch": {"sledenv.agents.best_fixed": few}}))
    with pytest.raises(SuiteError, match="'context' is no setting; there are n_timesteps, contexts"):
        list(suite.jobs())


def test_an_agent_is_another_when_its_code_or_that_of_its_base_has_changed(tmp_path, monkeypatch):
    """Oracle: the digest goes with the text of both files, and with no other."""
    monkeypatch.syspath_prepend(tmp_path)

    def code(**texts):
        for name, text in texts.items():
            (tmp_path / f"{name}.py").write_text(text)
        for name in ("own_agent", "own_base"):
            sys.modules.pop(name, None)
        return meant("own_agent", Problem(own_scenario("ice_drop")), {}, 0)["code"]

    agent, base = "from own_base import Base\n\n\nclass Agent(Base):\n    pass\n", "class Base:\n    spin = 1.0\n"
    before = code(own_agent=agent, own_base=base, own_other="")
    assert code(own_other="a = 1\n") == before
    changed = code(own_agent=agent + "    lift = 2.0\n"), code(own_agent=agent, own_base=base + "    lift = 2.0\n")
    assert len({before, *changed}) == 3
    assert code(own_base=base) == before


def test_every_shipped_suite_can_be_read_and_its_agents_imported():
    for path in (ROOT / "configs" / "suites").glob("*.yaml"):
        suite = Suite.load(path.stem)
        assert suite.id == path.stem
        names = [job.name for job in suite.jobs()]
        assert len(set(names)) == len(names) > 0
    with pytest.raises(SuiteError, match=r"unknown suite 'smoek' \(did you mean 'smoke'\?\); known: .*; a file"):
        Suite.load("smoek")


def test_a_folder_that_another_process_writes_is_left_alone(finished):
    """Oracle: a process that holds its lock, and is killed then."""
    file, folder, found = finished
    script = (
        "import sys; from pathlib import Path\n"
        "from sledenv.machine.files import alone\n"
        "with alone(Path(sys.argv[1]), wait=False): print('held', flush=True); sys.stdin.read()\n"
    )
    command = [sys.executable, "-c", script, folder / ".lock"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(BlockingIOError, match="another process writes there"):
            run_suite(Suite.load(file), folder, workers=1)
        process.kill()
    same(run(file, folder, workers=1), found)
