"""Answers: what the sim would refuse is refused here, with its place; what recordings pack comes back."""

import struct
import unittest

import numpy as np
from small_sim import message_taken

import reloop
from reloop.prediction import unpacked
from reloop.views.taken import KnownWays


def packed(numbers):
    """As the recorder packs a column: fourth differences of the bits, modulo 2^64 (docs/recordings.md)."""
    last, changes = [0] * 4, []
    for place, number in enumerate(numbers):
        (value,) = struct.unpack("<q", struct.pack("<d", number))
        for order in range(min(place, 4)):
            last[order], value = value, value - last[order]
        if place < 4:
            last[place] = value
        changes.append((value + 2**63) % 2**64 - 2**63)
    return changes


class PlanTest(unittest.TestCase):
    def test_its_states_are_a_message_and_come_back(self):
        states = np.arange(200.0).reshape(50, 4)
        plan = reloop.Plan(states, np.ones((50, 2)), objective={"speed": 2.0}, iterations=3, status="found")
        message = plan.message(9)
        self.assertEqual((message.step, message.states[1].speed, message.controls[49].steering), (9, 7.0, 1.0))
        back = reloop.Plan.read(message)
        np.testing.assert_array_equal(back.states, states)
        self.assertEqual((back.objective, back.iterations, back.status), ({"speed": 2.0}, 3, "found"))

    def test_what_the_sim_would_refuse_is_named(self):
        states = np.zeros((50, 4))
        bad = states.copy()
        bad[3, 3] = np.inf
        far = states.copy()
        far[49, 0] = -1.1e7
        for answer, said in (
            (None, r"plan\(\) gave back nothing: return an array of shape \(50, 4\)"),
            ("left", "no array of numbers"),
            (states[:49], r"the states have the shape \(49, 4\), and \(50, 4\) is needed: x, y, heading, speed"),
            (bad, "the states, row 3: speed is inf"),
            (far, "the states, row 49: x is -11000000.0"),
            (reloop.Plan(states, np.zeros((50, 3))), r"the controls have the shape \(50, 3\)"),
        ):
            with self.subTest(said), self.assertRaisesRegex(reloop.AnswerError, said):
                reloop.Plan.of(answer).message(0)


class PredictionTest(unittest.TestCase):
    def test_it_is_a_message_and_comes_back(self):
        poses = np.random.default_rng(1).normal(size=(2, 50, 3))
        controls = poses[0, :, :2]
        told = reloop.Prediction([reloop.Future(0.25, [4, 9], poses, controls), reloop.Future(0.75, [4, 9], -poses)])
        back = reloop.Prediction.read(told.message(7))
        np.testing.assert_array_equal(back.futures[0].poses, poses)
        np.testing.assert_array_equal(back.futures[0].controls, controls)
        self.assertFalse(back.futures[0].controls.flags.writeable)
        self.assertIsNone(back.futures[1].controls)
        self.assertEqual((back.likeliest.probability, back.likeliest.track.tolist()), (0.75, [4, 9]))
        self.assertEqual(reloop.Prediction([]).message(7).step, 7)
        self.assertIsNone(reloop.Prediction([]).likeliest)

    def test_what_the_sim_would_refuse_is_named(self):
        poses = np.zeros((1, 50, 3))
        bad = poses.copy()
        bad[0, 5, 2] = np.nan
        for futures, said in (
            ([reloop.Future(0.4, [1], poses)], r"probabilities \(0.4\) are no distribution: they sum to 0.4"),
            ([reloop.Future(1.5, [1], poses), reloop.Future(-0.5, [1], poses)], "are no distribution"),
            ([reloop.Future(float("nan"), [1], poses)], "are no distribution"),
            ([reloop.Future(1.0, [1, 2], poses)], r"shape \(1, 50, 3\), and \(2, 50, 3\) is needed"),
            ([reloop.Future(1.0, [1], bad)], "the poses, row 0, 5: heading is nan"),
            (
                [reloop.Future(1.0, [1], poses, poses[0])],
                r"the controls of a future have the shape \(50, 3\), and \(50, 2\) is needed: acceleration, steering",
            ),
            ([reloop.Future(1.0, [1], poses, bad[0, :, 1:])], "the controls of a future, row 5: steering is nan"),
        ):
            with self.subTest(said), self.assertRaisesRegex(reloop.AnswerError, said):
                reloop.Prediction(futures).message(0)

    def test_every_bit_of_a_packed_column_comes_back(self):
        rng = np.random.default_rng(2)
        bits = rng.integers(-(2**63), 2**63 - 1, size=60, dtype=np.int64)
        for column in (bits.view(np.float64), 812.4 + 9.3 * np.arange(50) * 0.1, bits[:3].view(np.float64), bits[:0]):
            numbers = np.asarray(column, dtype=np.float64)
            back = unpacked(packed(numbers.tolist()))
            # A NaN's bits may change in Python's own hands; every other number's do not.
            np.testing.assert_array_equal(back, numbers)

    def test_a_recorded_prediction_is_read_packed_or_not(self):
        poses = np.cumsum(np.random.default_rng(3).normal(size=(1, 50, 3)), axis=1)
        controls = poses[0, :, 1:]
        message = reloop.Prediction([reloop.Future(1.0, [4], poses, controls)]).message(0)
        (future,) = message.futures
        (trajectory,) = future.trajectories
        for name in ("x", "y", "heading"):
            getattr(trajectory, f"{name}_bits").extend(packed(getattr(trajectory, name)))
            trajectory.ClearField(name)
        for name in ("acceleration", "steering"):
            getattr(future, f"{name}_bits").extend(packed(getattr(control, name) for control in future.controls))
        future.ClearField("controls")
        (back,) = reloop.Prediction.read(message).futures
        np.testing.assert_array_equal(back.poses, poses)
        np.testing.assert_array_equal(back.controls, controls)
        # One that is damaged: what it lacks is NaN.
        del future.steering_bits[40:]
        (back,) = reloop.Prediction.read(message).futures
        self.assertTrue(np.isnan(back.controls[40:, 1]).all() and not np.isnan(back.controls[:, 0]).any())


def taken(*tracks):
    message = message_taken(0)
    one = message.agents[0]
    for track in tracks:
        message.agents.add().CopyFrom(one)
        message.agents[-1].agent.track = track
    del message.agents[0]
    return KnownWays().taken(message)


class MovesTest(unittest.TestCase):
    def test_they_are_a_message_in_the_order_of_who_was_given(self):
        states = np.arange(10.0).reshape(2, 5)
        for answer in (states, reloop.Moves(states[::-1], track=[9, 5])):
            message = reloop.Moves.of(answer).message(4, taken(5, 9))
            self.assertEqual((message.step, [agent.track for agent in message.agents]), (4, [5, 9]))
            state = message.agents[1].state
            self.assertEqual((state.x, state.y, state.heading, state.velocity_x, state.velocity_y), (5, 6, 7, 8, 9))
            self.assertEqual((state.length, state.width, state.height), (4.0, 1.8, 1.5))
        lifted = reloop.Moves(states, z=[1.0, 2.0]).message(4, taken(5, 9))
        self.assertEqual([agent.state.z for agent in lifted.agents], [1.0, 2.0])
        self.assertEqual(len(reloop.Moves.of([]).message(4, ()).agents), 0)

    def test_what_the_sim_would_refuse_is_named(self):
        states = np.zeros((2, 5))
        bad = states.copy()
        bad[1, 3] = np.nan
        for answer, said in (
            (None, r"moves\(\) gave back nothing: return an array of shape \(agents, 5\)"),
            ("left", "no array of numbers"),
            (states[:1], r"shape \(1, 5\), and \(2, 5\) is needed: x, y, heading, velocity_x, velocity_y"),
            (bad, "the states, row 1: velocity_x is nan"),
            (reloop.Moves(states, z=[0.0, np.inf]), "the heights, row 1: z is inf"),
            (reloop.Moves(states[:1], track=[5]), "does not say where track 9 is next"),
            (reloop.Moves(np.zeros((3, 5)), track=[5, 9, 5]), "says twice where track 5 is next"),
            (reloop.Moves(np.zeros((3, 5)), track=[5, 9, 7]), "moves track 7, which it was not given"),
        ):
            with self.subTest(said), self.assertRaisesRegex(reloop.AnswerError, said):
                reloop.Moves.of(answer).message(0, taken(5, 9))


if __name__ == "__main__":
    unittest.main()
