"""A suite and a study on a Ray cluster: the numbers are those of one process."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
import yaml

from sledenv.benchmark.results import read_results
from sledenv.benchmark.runner import run_suite
from sledenv.benchmark.suite import Suite
from sledenv.uncertainty import run, study
from tests.own_scenarios import own_scenario
from tests.uncertainty.make import PUSH, made

pytest.importorskip("ray.cluster_utils")
ROOT = Path(__file__).parents[2]


pytestmark = pytest.mark.filterwarnings("ignore")  # of Ray, which this project does not own


@pytest.fixture
def cluster() -> Iterator[str]:
    """Address of a head without a core and two nodes with one each."""
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    try:
        for _ in range(2):
            nodes.add_node(num_cpus=1)
        yield nodes.address
    finally:
        nodes.shutdown()


def test_two_workers_of_a_cluster_give_the_numbers_of_one_process(cluster, tmp_path):
    """Oracle: one process here."""
    file = tmp_path / "tiny.yaml"
    settings = ROOT / "configs" / "agents"
    content = {"id": "tiny", "title": "A test", "contexts": 3, "settings": str(settings)}
    content |= {"steps": 200, "scenarios": [own_scenario("ice_drop")]}
    agents = {"sledenv.agents.zero": 1, "sledenv.agents.random_launch": 2, "sledenv.agents.best_fixed": 2}
    content |= {"agents": {"launch": agents}}
    file.write_text(yaml.safe_dump(content))
    suite = Suite.load(file)
    found = [
        read_results(suite, run_suite(suite, tmp_path / folder, **how))
        for folder, how in (("one", {"workers": 1}), ("two", {"ray": cluster}))
    ]
    for one, two in zip(*found, strict=True):
        timed = [column for column in one if str(column).startswith("train_")]
        pd.testing.assert_frame_equal(one.drop(columns=timed), two.drop(columns=timed), check_exact=True)


def test_a_study_on_a_cluster_finds_what_one_process_does(cluster, tmp_path, monkeypatch):
    """Oracle: one process here, bit for bit."""
    monkeypatch.setattr(run, "BLOCK", 80)
    one = study(made(PUSH), tmp_path / "one", workers=1, progress=False)
    two = study(made(PUSH), tmp_path / "two", ray=cluster, progress=False)
    assert len(one.files) > 1
    for file in one.folder.rglob("*.parquet"):
        assert file.read_bytes() == (two.folder / file.relative_to(one.folder)).read_bytes()
