"""Recordings: whole ones, those that are cut off, and what is none."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from small_sim import message_observation, message_scene

import reloop
from reloop import messages

PLAN = reloop.Plan(np.ones((50, 4)))
MOVES = messages.TrafficMoves(step=1)
MOVED = MOVES.agents.add(track=7).state
MOVED.x, MOVED.y, MOVED.z, MOVED.heading, MOVED.velocity_x, MOVED.velocity_y = 1, 2, 3, 4, 5, 6


def write(path, steps=3, end=True):
    """A recording of a drive along the straight road, as the recorder orders it."""
    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD, chunk_size=2_000)
        writer.start()
        writer.add_metadata("reloop", {"run": "mine-strict", "run.toml": '[settings]\ndriver = "mine"\n'})
        schema = writer.register_schema("any", "protobuf", b"")
        channels = {}

        def say(channel, message, step):
            if channel not in channels:
                channels[channel] = writer.register_channel(f"/reloop/{channel}", "protobuf", schema)
            writer.add_message(channels[channel], step * 10**8, message.SerializeToString(), step * 10**8)

        say("scene", message_scene(), 0)
        for step in range(steps):
            say("observation", message_observation(step), step)
            say("plan", PLAN.message(step), step)
            if step == 1:
                say("moves", MOVES, step)
                # One too many, of a process that lies.
                say("moves", messages.TrafficMoves(step=step, error="no idea"), step)
            record = messages.StepRecord(step=step, log_index=3 + step, station=21.0 + step, events=int(step == 1))
            record.av.x = 21.0 + step
            say("record", record, step)
            if step == 1:
                say("event", messages.Event(step=1, kind=messages.Event.SPEEDING, text="too fast"), step)
        if end:
            metrics = [{"name": "progress_m", "value": 2.0}, {"name": "progress_ratio"}]
            say("end", messages.EpisodeEnd(reason=6, detail="step 3: no answer", metrics=metrics), steps)
        writer.finish()


class RecordingTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name, "straight.mcap")

    def test_it_is_a_sequence_of_steps_with_all_that_was_said(self):
        write(self.path)
        episode = reloop.episode(self.path)
        self.assertEqual((len(episode), episode.scene.id, episode.damage), (3, "straight", None))
        self.assertEqual((episode.run, episode.settings), ("mine-strict", {"settings": {"driver": "mine"}}))
        step = episode[1]
        self.assertEqual((step.number, step.time, step.observation.av.x, step.record.station), (1, 0.1, 21.0, 22.0))
        self.assertEqual((step.prediction, step.plan.states.shape), (None, (50, 4)))
        self.assertEqual((step.moves.track.tolist(), step.moves.states.tolist()), ([7], [[1, 2, 4, 5, 6]]))
        self.assertEqual((step.moves.z.tolist(), step.moves.error, episode[0].moves), ([3], "", None))
        self.assertEqual([event.text for event in step.events], ["too fast"])
        self.assertEqual([event.step for event in episode.events], [1])
        self.assertEqual(step.observation.history.log_index.tolist(), [1, 2, 3])
        self.assertEqual((episode.end_reason, episode.end.detail), ("driver-failed", "step 3: no answer"))
        self.assertEqual(episode.metrics, {"progress_m": 2.0, "progress_ratio": None})

    def test_its_records_are_a_frame(self):
        write(self.path)
        frame = reloop.episode(self.path).records
        self.assertEqual(frame["av_x"].tolist(), [21.0, 22.0, 23.0])
        self.assertTrue(frame["time_to_collision"].isna().all())

    def test_one_that_is_cut_off_is_read_as_far_as_it_goes(self):
        write(self.path, steps=9)
        whole = self.path.read_bytes()
        self.path.write_bytes(whole[: len(whole) * 6 // 10])
        episode = reloop.episode(self.path)
        self.assertLess(len(episode), 9)
        self.assertEqual((episode.scene.id, episode.end, episode.end_reason), ("straight", None, ""))
        self.assertTrue(episode.damage)
        self.assertIn("cut off", repr(episode))

    def test_a_damaged_byte_is_noticed(self):
        write(self.path)
        damaged = bytearray(self.path.read_bytes())
        damaged[len(damaged) * 7 // 10] ^= 0xFF
        self.path.write_bytes(damaged)
        self.assertTrue(reloop.episode(self.path).damage)

    def test_what_is_no_recording_is_refused(self):
        self.path.write_bytes(b"nothing of the kind")
        with self.assertRaisesRegex(reloop.ReadError, "holds no scene: .*\n  hint: recordings are the .mcap files"):
            reloop.episode(self.path)
        with self.assertRaisesRegex(reloop.ReadError, "cannot be read: No such file"):
            reloop.episode(self.path.with_name("other.mcap"))


if __name__ == "__main__":
    unittest.main()
