"""Suites: what is refused, that numbers do not depend on how they were run, and that nothing is lost or repeated."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from sledenv.benchmark.problem import TRIALS, Problem
from sledenv.benchmark.runner import TABLES, run_suite
from sledenv.benchmark.runs import meant
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
    "maps": 1,
    "scenarios": [own_scenario("boulders"), own_scenario("spinning_entry")],
    "agents": {"launch": {"sledenv.agents.zero": 1, "sledenv.agents.random_launch": 2, "sledenv.agents.best_fixed": 2}},
}


def written(folder: Path, **changes: object) -> Path:
    """File of a suite with some keys changed; None removes a key."""
    content = {key: value for key, value in (SUITE | changes).items() if value is not None}
    path = folder / "tiny.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def tables(folder: Path) -> dict[str, pd.DataFrame]:
    """All tables of a finished suite, without what was timed."""
    found = {name: pd.read_parquet(folder / f"{name}.parquet") for name in TABLES}
    return found | {"runs": found["runs"].drop(columns=TIMES)}


def same(one: dict[str, pd.DataFrame], other: dict[str, pd.DataFrame]) -> None:
    for name in TABLES:
        pd.testing.assert_frame_equal(one[name], other[name], check_exact=True)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, pd.DataFrame]]:
    """A suite that was run by one worker without interruption: its file, its folder, its tables."""
    home = tmp_path_factory.mktemp("suite")
    file = written(home)
    folder = run_suite(Suite.load(file), home / "out", workers=1)
    return file, folder, tables(folder)


def test_a_suite_judges_every_agent_on_every_scenario(finished):
    """Oracle: counting; rewards are those of the simulator; no agent earns more than the best launch."""
    _, folder, found = finished
    results = found["results"]
    assert len(results) == 2 * (1 + 2 + 2) * 2  # scenarios, seeds, contexts
    assert len(found["runs"]) == 10
    assert found["runs"].set_index("agent")["descents"].groupby("agent").max().to_dict() == {
        "best_fixed": 240,
        "random_launch": 0,
        "zero": 0,
    }
    problem = Problem(own_scenario("boulders"))
    chosen = results.query("scenario == 'boulders' and agent == 'best_fixed' and seed == 1")
    trials = problem.trials(problem.contexts("test", 2), "test")
    again = problem.descend(trials.reshape(-1, 14), chosen[["action_0"]].to_numpy().repeat(TRIALS, axis=0))
    assert np.array_equal(again.jam.reward.reshape(2, -1).mean(axis=1), chosen["reward"])
    assert np.array_equal(again.outcomes["sliding"].reshape(2, -1).mean(axis=1), chosen["loss_sliding"])
    best = found["oracle"].set_index(["scenario", "context"])["reward"]
    earned = results.set_index(["scenario", "context"])["reward"]
    assert (earned <= 1.003 * best.loc[earned.index]).all()
    assert not list(folder.rglob("*.part"))


def test_the_columns_that_are_written_are_those_that_are_told(finished):
    """Oracle: the table in docs/benchmark.md; what needs more choices or hidden fields is not in every scenario."""
    page = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    rows = page.partition("### Columns of the tables")[2].partition("\n#")[0].split("\n")
    told = {name: set() for name in TABLES}
    for tables_of, columns in (row.split("|")[1:3] for row in rows if row.startswith("|")):
        named = re.findall(r"`(\w+)`", tables_of)
        if " all" in tables_of:
            named = [name for name in TABLES if name not in named]
        for name in named:
            told[name] |= set(re.findall(r"`(\w+)`", columns))
    some = {"action_1", "action_2", "seen", "seen_0", "seen_1", "seen_2", "best_of_16", "best_of_64", "best_of_256"}
    told["oracle"] -= some
    for name, table in finished[2].items():
        columns = set(table) | (set(TIMES) if name == "runs" else set())
        assert columns - (some if name == "oracle" else set()) == told[name]


def test_the_numbers_do_not_depend_on_the_number_of_workers(finished, tmp_path):
    """Oracle: one worker against two."""
    file, _, found = finished
    same(tables(run_suite(Suite.load(file), tmp_path / "out", workers=2)), found)


def test_what_was_deleted_is_built_again_and_nothing_else(finished, monkeypatch):
    """Oracle: the tables as they were; only the deleted job and run are trained or judged again."""
    file, folder, found = finished
    trained = []
    monkeypatch.setattr("sledenv.benchmark.runner.train", lambda *given: trained.append(given) or real(*given))
    from sledenv.benchmark.runs import train as real

    one, two = sorted((folder / "judged").glob("launch-boulders-best_fixed-*"))
    one.unlink()
    same(tables(run_suite(Suite.load(file), folder, workers=1)), found)
    assert not trained
    two.unlink()
    (folder / "results.parquet").unlink()
    config = folder / "trained" / "launch-boulders-best_fixed-s1" / "config.yaml"
    config.write_text(config.read_text().replace("n_timesteps: 240", "n_timesteps: 241"))
    same(tables(run_suite(Suite.load(file), folder, workers=1)), found)
    assert [(given[0], given[3]) for given in trained] == [("sledenv.agents.best_fixed", 1)]


def test_an_agent_whose_file_is_gone_or_cut_is_trained_again_and_named(finished, caplog):
    """Oracle: the tables as they were; a judged job whose agent is not needed is left alone."""
    file, folder, found = finished
    for i, name in enumerate(("launch-boulders-best_fixed-s0", "launch-boulders-random_launch-s1")):
        (kept,) = (path for path in (folder / "trained" / name).glob("*.yaml") if path.stem in ("action", "random"))
        kept.unlink() if i == 0 else kept.write_text("[")
        (judged,) = (folder / "judged").glob(f"{name}-*")
        judged.unlink()
    same(tables(run_suite(Suite.load(file), folder, workers=1)), found)
    told = [message for message in caplog.messages if message.startswith("sledenv: training again: agent")]
    assert len(told) == 2
    assert "action.yaml" in told[0] + told[1]


def test_what_was_altered_is_judged_again_and_named(finished, caplog):
    """Oracle: the tables as they were, after an edited reward, a cut file and one of something else."""
    file, folder, found = finished
    edited, cut, other = sorted((folder / "judged").glob("launch-boulders-*"))[:3]
    table = pd.read_parquet(edited)
    table.loc[0, "reward"] += 1e-9
    table.to_parquet(edited, index=False)
    cut.write_bytes(cut.read_bytes()[:-100])
    pd.DataFrame({"reward": [1.0]}).to_parquet(other)
    same(tables(run_suite(Suite.load(file), folder, workers=1)), found)
    told = [message for message in caplog.messages if message.startswith("sledenv: judging again")]
    assert all(str(path) in message for path, message in zip((edited, cut, other), sorted(told), strict=True))


@pytest.mark.slow
def test_a_suite_that_is_killed_goes_on_where_it_was(finished, tmp_path):
    """Oracle: the tables of the run that was not interrupted; what had been judged is not touched again."""
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
    while len(list((folder / "judged").glob("*.parquet"))) < 3:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    process.wait()
    before = {path: path.stat().st_mtime_ns for path in (folder / "judged").glob("*.parquet")}
    same(tables(run_suite(Suite.load(file), folder, workers=1)), found)
    assert {path: path.stat().st_mtime_ns for path in before} == before


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contexts": 1}, "contexts = 1: must be a whole number in [2, 100000]"),
        ({"contexts": None}, "contexts: missing"),
        ({"scenarios": ["sled_snwo"]}, "did you mean 'sled_snow'"),
        ({"scenarios": [own_scenario("ice_drop"), own_scenario("ice_drop")]}, "must not repeat a scenario"),
        ({"agents": {"flight": {"sledenv.agents.zero": 1}}}, "'launch' or 'descent'"),
        (
            {"agents": {"launch": {"sledenv.agents.zero": 0}}},
            "sledenv.agents.zero.seeds = 0: must be a whole number in [1, 1000]",
        ),
        ({"agents": {}}, "agents: must have at least 1 entry"),
        ({"agents": {"launch": {"sledenv.agents.sac": 1, "mine.sac": 1}}}, "must not have two agents called 'sac'"),
        ({"agents": {"launch": {"sledenv.agents.zero": {"seeds": 1, "varaints": {}}}}}, "did you mean 'variants'?"),
        (
            {"agents": {"launch": {"sledenv.agents.best_fixed": {"seeds": 1, "variants": {"../k": {}}}}}},
            "must have names of letters, digits and _, not '../k'",
        ),
        ({"observe": ["frictoin"]}, "must be 'all' or list fields of the context"),
        ({"exact": 3}, "exact = 3"),
        ({"seeds": 3}, "seeds = 3: unknown key (did you mean 'steps'?); known: id, title"),
    ],
)
def test_a_wrong_suite_is_refused_by_name_of_the_key(changes, message, tmp_path):
    with pytest.raises(SuiteError, match=r"tiny\.yaml") as error:
        Suite.load(written(tmp_path, **changes))
    assert message in str(error.value)


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


def test_steps_of_a_suite_are_for_agents_that_have_a_budget(tmp_path):
    """One that looks ahead has settings, but learns nothing."""
    agents = {"descent": {"sledenv.agents.replan": 1, "sledenv.agents.ppo": 1}}
    suite = Suite.load(written(tmp_path, agents=agents, scenarios=["sled_rollers"]))
    settings = {job.agent: job.settings for job in suite.jobs()}
    assert list(settings["replan"]) == ["spins"]
    assert settings["ppo"]["n_timesteps"] == 240


def test_a_misspelt_key_is_named_before_the_one_that_is_missing(tmp_path):
    with pytest.raises(SuiteError) as error:
        Suite.load(written(tmp_path, title=None, tilte="A test"))
    first, second = str(error.value).splitlines()
    assert "tilte = 'A test': unknown key (did you mean 'title'?)" in first
    assert second.endswith("tiny.yaml: title: missing")


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
    same(tables(run_suite(Suite.load(file), folder, workers=1)), found)


def test_a_suite_that_says_something_twice_is_refused(tmp_path):
    """Oracle: the reader of scenarios."""
    file = written(tmp_path)
    file.write_text(file.read_text() + "contexts: 8\n")
    with pytest.raises(SuiteError, match=r"tiny\.yaml: cannot be read: repeated key 'contexts'"):
        Suite.load(file)


@pytest.mark.parametrize(
    ("agent", "message"),
    [
        ("sledenv.agents.zorro", "there is no such module"),
        ("sledenv.agents.evaluate", "no class Agent"),
    ],
)
def test_an_agent_that_is_none_is_refused_before_anything_is_written(agent, message, tmp_path):
    file = written(tmp_path, agents={"launch": {agent: 1}})
    with pytest.raises(SuiteError, match=message):
        run_suite(Suite.load(file), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_settings_are_those_that_ship_unless_others_are_named(tmp_path):
    """Oracle: the same suite that names their folder."""
    jobs = [list(Suite.load(written(tmp_path, **named)).jobs()) for named in ({}, {"settings": None})]
    assert jobs[0] == jobs[1]
    assert {job.agent for job in jobs[0] if job.settings} == {"best_fixed"}


def test_settings_that_are_not_there_are_missed_before_anything_is_written(tmp_path):
    file = written(tmp_path, settings="../agents")
    with pytest.raises(SuiteError, match=r"settings = '/.*/agents': there is no such folder"):
        run_suite(Suite.load(file), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_agent_whose_settings_are_missing_is_refused_before_anything_is_written(tmp_path):
    """One that ships without settings needs none in a folder of one's own either."""
    (tmp_path / "mine").mkdir()
    agents = {"sledenv.agents.zero": 1, "sledenv.agents.best_fixed": 1}
    file = written(tmp_path, settings="mine", agents={"launch": agents})
    message = (
        r"suite tiny: /.*/mine/best_fixed\.yaml: missing, but agent sledenv\.agents\.best_fixed needs settings: copy"
    )
    with pytest.raises(SuiteError, match=message):
        run_suite(Suite.load(file), tmp_path / "out")
    assert not (tmp_path / "out").exists()
    jobs = list(Suite.load(written(tmp_path, settings="mine", agents={"launch": {"sledenv.agents.zero": 1}})).jobs())
    assert {job.agent for job in jobs} == {"zero"}


def test_every_shipped_suite_can_be_read_and_its_agents_imported():
    for path in (ROOT / "configs" / "suites").glob("*.yaml"):
        suite = Suite.load(path.stem)
        assert suite.id == path.stem
        names = [job.name for job in suite.jobs()]
        assert len(set(names)) == len(names) > 0
    with pytest.raises(SuiteError, match=r"unknown suite 'smoek' \(did you mean 'smoke'\?\); known: .*; a file"):
        Suite.load("smoek")
