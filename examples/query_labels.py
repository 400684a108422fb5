"""Ask the labels of all episodes: `python query_labels.py DATASET` (extra `sql`)."""

import sys

from carstage.dataset import Dataset

CLASSES = """
    SELECT class, count(DISTINCT instance_uid) AS objects, count(*) AS labels,
           round(avg(sqrt(velocity[1] ** 2 + velocity[2] ** 2)), 1) AS mean_speed_mps
    FROM objects WHERE NOT is_ego GROUP BY class ORDER BY labels DESC
"""
NEAREST = """
    SELECT o.episode_id, c.k, c.sensor_id, o.class, round(c.distance, 1) AS distance_m
    FROM camera_objects c JOIN objects o USING (episode_id, k, track_id)
    WHERE c.visible ORDER BY c.distance LIMIT 5
"""
LIGHTS = """
    SELECT o.traffic_light_state AS state, count(DISTINCT o.track_id) AS lights, count(*) AS labels
    FROM camera_objects c JOIN objects o USING (episode_id, k, track_id)
    WHERE c.visible AND o.class = 'traffic_light' GROUP BY state ORDER BY labels DESC
"""
QUERIES = {"Classes": CLASSES, "Nearest visible objects": NEAREST, "Traffic lights seen": LIGHTS}


def main() -> None:
    """Run the example."""
    dataset = Dataset(sys.argv[1])
    for title, query in QUERIES.items():
        rows = dataset.sql(query).to_pylist()  # a pyarrow table: .to_pandas() works as well
        print(title)
        for row in rows:
            print("  " + ", ".join(f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
