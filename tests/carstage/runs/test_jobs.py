"""The jobs of a run: in the order of the plan, those that come back first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from carstage.config import check_config
from carstage.plan import ServerFacts, plan_episodes
from carstage.runs.jobs import JobQueue

PLAN = plan_episodes(check_config({"episodes": 5}), ServerFacts(maps={"Stage01": 50}))


def taken(jobs: JobQueue) -> list[str]:
    found = []
    while jobs:
        found.append(jobs.popleft().episode_id)
    return found


def test_jobs_come_in_the_order_of_the_plan() -> None:
    jobs = JobQueue(PLAN)
    assert len(jobs) == 5
    assert [job.spec for job in jobs] == list(PLAN)
    assert tuple(taken(jobs)) == PLAN.ids
    with pytest.raises(IndexError):
        jobs.popleft()


def test_a_job_that_comes_back_is_next() -> None:
    jobs = JobQueue(PLAN)
    first = jobs.popleft()
    jobs.appendleft(replace(first, tries=1))
    assert len(jobs) == 5
    assert jobs.popleft().tries == 1
    assert tuple(taken(jobs)) == PLAN.ids[1:]


def test_what_is_left_out_is_not_taken_unless_it_comes_back() -> None:
    jobs = JobQueue(PLAN)
    first = next(iter(jobs))
    jobs.leave_out({PLAN.ids[0], PLAN.ids[4]})
    assert len(jobs) == 3
    assert [job.episode_id for job in jobs] == list(PLAN.ids[1:4])
    jobs.appendleft(first)
    assert tuple(taken(jobs)) == PLAN.ids[:4]


def test_dropping_all_says_how_many_there_were() -> None:
    jobs = JobQueue(PLAN)
    jobs.leave_out({PLAN.ids[2]})
    jobs.appendleft(jobs.popleft())
    assert jobs.clear() == 4
    assert not jobs
