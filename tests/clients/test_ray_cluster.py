"""A suite on a Ray cluster: the numbers are those of one process."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
import yaml

from sledenv.benchmark.runner import TABLES, run_suite
from sledenv.benchmark.suite import Suite

pytest.importorskip("ray.cluster_utils")
ROOT = Path(__file__).parents[2]


@pytest.mark.filterwarnings("ignore")  # of Ray, which this project does not own
def test_two_workers_of_a_cluster_give_the_numbers_of_one_process(tmp_path):
    """Oracle: one process here; the cluster is a head without a core and two nodes with one each."""
    from ray.cluster_utils import Cluster

    file = tmp_path / "tiny.yaml"
    content = {"id": "tiny", "title": "A test", "contexts": 3, "settings": str(ROOT / "configs" / "agents")}
    content |= {"steps": 200, "scenarios": ["ice_drop"], "maps": 1}
    content |= {"agents": {"launch": {"agents.zero": 1, "agents.random_launch": 2, "agents.best_fixed": 2}}}
    file.write_text(yaml.safe_dump(content))
    suite = Suite.read(file)
    run_suite(suite, file, tmp_path / "one", workers=1)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    try:
        for _ in range(2):
            cluster.add_node(num_cpus=1)
        run_suite(suite, file, tmp_path / "two", ray=cluster.address)
    finally:
        cluster.shutdown()
    for name in TABLES:
        one, two = (pd.read_parquet(tmp_path / folder / f"{name}.parquet") for folder in ("one", "two"))
        timed = [column for column in one if str(column).startswith("train_")]
        pd.testing.assert_frame_equal(one.drop(columns=timed), two.drop(columns=timed), check_exact=True)
