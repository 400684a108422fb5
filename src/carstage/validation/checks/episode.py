"""The checks of an episode's documents and tables."""

from __future__ import annotations

from carstage.dataset.ledger import recorded_frames, saved_times_s
from carstage.dataset.reading import Episode
from carstage.dataset.tracks import may_come_back
from carstage.sensor_kinds.model import ROWS
from carstage.validation.checks.camera_verdicts import check_camera_verdicts
from carstage.validation.checks.columns import (
    check_camera_columns,
    check_ego_columns,
    check_object_columns,
)
from carstage.validation.checks.completeness import check_gaps
from carstage.validation.checks.controls import check_controls
from carstage.validation.checks.documents import require_document, require_twins
from carstage.validation.checks.events import check_events
from carstage.validation.checks.figures import TableFigures
from carstage.validation.checks.files import (
    DOCUMENTS,
    Listing,
    VerifiedFiles,
    check_file_list,
    tables_of,
)
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables, check_labels, labelled_boxes
from carstage.validation.checks.ledger import check_ledger, check_row_sensors
from carstage.validation.checks.level import check_level_boxes
from carstage.validation.checks.motion import check_motion, compare_motion
from carstage.validation.checks.nulls import check_nulls
from carstage.validation.checks.population import Population, check_episode_population
from carstage.validation.checks.radars import check_cross_sections, check_radar_counts
from carstage.validation.checks.readings import check_readings, check_sensor_poses
from carstage.validation.checks.server import check_self_test
from carstage.validation.checks.table_schema import require_ledger
from carstage.validation.checks.tracks import check_tracks


def check_episode(episode: Episode, listing: Listing, findings: Findings) -> TableFigures:
    """Look at everything of an episode but its frames.

    Args:
        episode: the episode.
        listing: what lies in its folder.
        findings: where problems go.

    Raises:
        DatasetError: a document or table is missing or damaged, so that nothing can be said.
    """
    files = VerifiedFiles(episode, listing, findings)
    files.report_missing()
    with files.fetched_ahead():
        for name in DOCUMENTS:
            files.read(name)
        for name in tables_of(episode):
            files.read(name)
    ledger = require_ledger(episode.ledger())
    recorded = recorded_frames(episode.calibration.sensors, ledger)
    check_file_list(episode, recorded, findings)
    check_ledger(episode, ledger, findings)
    for sensor in episode.sensors:
        if sensor.content in ROWS:
            files.read(sensor.file_names(0)[0], sensor=sensor.id)
    check_row_sensors(episode, ledger, recorded, findings)
    check_self_test(episode, findings)
    require_document(episode)
    require_twins(episode)
    tables = LabelTables.load(episode)
    check_nulls(episode, tables, findings)
    tables.require_values(episode)
    check_labels(episode, tables, saved_times_s(ledger), findings)
    check_ego_columns(episode, tables, findings)
    check_object_columns(episode, tables, findings)
    check_camera_columns(episode, tables, findings)
    check_camera_verdicts(episode, tables, findings)
    check_tracks(episode, tables, findings)
    check_sensor_poses(episode, tables, findings)
    check_readings(episode, tables, findings)
    check_cross_sections(episode, findings)
    check_events(episode, ledger, tables, findings)
    check_controls(episode, ledger, tables, findings)
    figures = TableFigures(files.files, files.bytes)
    _check_objects(episode, tables, figures, findings)
    check_radar_counts(episode, labelled_boxes(tables, findings), findings)
    return figures


def _check_objects(
    episode: Episode, tables: LabelTables, figures: TableFigures, findings: Findings
) -> None:
    truth = episode.spec.ground_truth
    check_gaps(
        tables.objects,
        episode.frames,
        ego_labelled=truth.vehicles and episode.spec.ego.is_vehicle,
        findings=findings,
    )
    for name, table, location in (
        (
            "objects.parquet",
            tables.objects.filter(~may_come_back(tables.objects)),
            "actor_location",
        ),
        ("ego.parquet", tables.ego, "location"),
    ):
        found = compare_motion(table, location)
        check_motion(name, found, findings)
        figures.motion.add(found)
    check_level_boxes(tables, findings)
    of_ego = episode.agent_name is None
    population = figures.population if of_ego else Population.empty()
    check_episode_population(episode, tables, population, findings)
