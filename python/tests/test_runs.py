"""What a run leaves, as frames."""

import os
import tempfile
import unittest
from pathlib import Path

import numpy as np
import pandas

import reloop
from reloop.runs import unit_of

#: A finished and recorded run of the real sim, if there is one: the tests of the repository drive it.
REAL = os.environ.get("RELOOP_FINISHED_RUN")


class RunTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def write(self):
        (self.folder / "run.toml").write_text('[settings]\ndriver = "mine"\n')
        pandas.DataFrame({"scene": ["a"], "progress_m": [3.0]}).to_parquet(self.folder / "results.parquet")
        (self.folder / "digest").write_text("abc\nresults.parquet 1\n")

    def test_units_are_in_attrs(self):
        self.write()
        run = reloop.results(self.folder)
        self.assertEqual(run.results["progress_m"].tolist(), [3.0])
        self.assertEqual(run.results.attrs["units"], {"progress_m": "m"})
        self.assertEqual((run.settings["settings"]["driver"], run.digest, run.recordings), ("mine", "abc", []))

    def test_a_units_longest_end_counts(self):
        columns = ("max_abs_yaw_acceleration_radps2", "jerk_mps3", "steering_rad", "wall_s", "position_error_3s_m")
        self.assertEqual([unit_of(c) for c in columns], ["rad/s²", "m/s³", "rad", "s", "m"])
        self.assertEqual([unit_of(c) for c in ("scene", "nuplan_score", "nuplan_terms", "steps")], [""] * 4)

    def test_what_is_no_run_or_not_finished_or_damaged_is_told_apart(self):
        with self.assertRaisesRegex(reloop.ReadError, "is no run: it has no run.toml\n  hint: "):
            reloop.results(self.folder)
        (self.folder / "run.toml").touch()
        with self.assertRaisesRegex(reloop.ReadError, "is not finished\n  hint: the same `sim run` command"):
            reloop.results(self.folder)
        self.write()
        (self.folder / "results.parquet").write_bytes(b"PAR1 and no more")
        run = reloop.results(self.folder)
        for name in ("results", "steps"):
            with self.assertRaisesRegex(reloop.ReadError, f"{name}.parquet cannot be read: "):
                getattr(run, name)


@unittest.skipUnless(REAL, "RELOOP_FINISHED_RUN names no run")
class RealRunTest(unittest.TestCase):
    """A run of the real sim: its files and its recordings say the same."""

    @classmethod
    def setUpClass(cls):
        cls.driven = reloop.results(REAL)
        cls.episodes = {episode.scene.id: episode for episode in map(reloop.episode, cls.driven.recordings)}

    def test_there_is_a_recording_of_each_episode_with_its_metrics(self):
        results = self.driven.results.set_index("scene")
        self.assertEqual(sorted(results.index), sorted(self.episodes))
        for scene, episode in self.episodes.items():
            row = results.loc[scene]
            self.assertEqual(
                (len(episode), episode.damage, episode.end_reason), (row["steps"], None, row["end_reason"])
            )
            for name, value in episode.metrics.items():
                np.testing.assert_equal(row[name], np.nan if value is None else value, err_msg=f"{scene} {name}")

    def test_each_step_of_the_file_is_one_of_the_recording(self):
        for scene, rows in self.driven.steps.groupby("scene"):
            records = self.episodes[scene].records
            np.testing.assert_array_equal(rows["av_x_m"], records["av_x"])
            np.testing.assert_array_equal(rows["acceleration_mps2"], records["control_acceleration"])
            np.testing.assert_array_equal(rows["time_to_collision_s"], records["time_to_collision"])
        self.assertEqual(self.driven.steps.attrs["units"]["yaw_rate_radps"], "rad/s")
        self.assertEqual(self.driven.timing.attrs["units"]["wall_s"], "s")

    def test_what_was_told_and_said_is_whole(self):
        for episode in self.episodes.values():
            after = None
            for step in episode:
                if after is not None:
                    self.assertEqual((step.observation.av.x, step.observation.av.y), (after.x, after.y))
                after = step.record.av
                self.assertEqual(step.plan.message(step.number).step, step.number)
                self.assertGreater(len(step.observation.window), 1)
                agents = step.observation.agents
                self.assertEqual(len(agents), len(set(agents.track.tolist())))
                if step.prediction is not None:
                    self.assertEqual(step.prediction.message(step.number).step, step.number)
                    (future,) = step.prediction.futures or [None]
                    for track, poses in zip(future.track, future.poses, strict=True) if future else []:
                        now = agents[agents.track == track]
                        speed = float(now.speed[0])
                        moved = np.hypot(poses[0, 0] - now.x[0], poses[0, 1] - now.y[0])
                        self.assertAlmostEqual(moved, 0.1 * speed, delta=0.02 + 0.01 * speed)

    def test_the_map_is_read_whole(self):
        for episode in self.episodes.values():
            lanes = episode.scene.map.lanes
            self.assertTrue(set(episode.scene.route) <= set(lanes))
            for lane in lanes.values():
                self.assertEqual(lane.centerline.shape[1], 3)
            for name in ("road_lines", "road_edges", "stop_signs", "crosswalks", "speed_bumps", "driveways"):
                self.assertIsInstance(getattr(episode.scene.map, name), dict)


if __name__ == "__main__":
    unittest.main()
