"""What the sim tells, as arrays."""

import unittest

import numpy as np
from small_sim import message_observation, message_scene, message_taken

import reloop
from reloop import messages
from reloop.views.history import History
from reloop.views.line import line, window
from reloop.views.scene import Scene
from reloop.views.step import step
from reloop.views.taken import KnownWays, Way


def bend(radius=20.0, samples=300):
    """A line that turns left about (0, radius), from the origin along +x."""
    message = messages.Scene().reference_line
    for k in range(samples):
        angle = 0.1 * k / radius
        message.x.append(radius * np.sin(angle))
        message.y.append(radius * (1 - np.cos(angle)))
        message.z.append(0.0)
        message.heading.append((angle + np.pi) % (2 * np.pi) - np.pi)
        message.curvature.append(1 / radius)
        message.speed_limit.append(0.0)
        message.crosswalk.append(k == 7)
    return line(message)


class WindowTest(unittest.TestCase):
    def test_it_is_the_stretch_of_the_line_that_the_numbers_say_and_no_copy(self):
        whole = bend()
        seen = messages.Observation(window_first_sample=5, window_samples=100, red_stops=[3])
        part = window(seen, whole)
        self.assertEqual((len(part), part.first_sample), (100, 5))
        for name in ("x", "y", "z", "heading", "curvature", "speed_limit", "crosswalk"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[5:105])
            self.assertTrue(np.shares_memory(getattr(part, name), getattr(whole, name)), name)
        self.assertEqual(part.crosswalk.tolist().index(True), 2)
        self.assertEqual(part.red_stops.tolist(), [3])
        self.assertEqual(part.station[0], 0.0)

    def test_one_limit_for_the_whole_window_takes_the_place_of_the_lines_own(self):
        seen = messages.Observation(window_samples=10, window_speed_limit=7.0)
        self.assertEqual(window(seen, bend()).speed_limit.tolist(), [7.0] * 10)
        seen = messages.Observation(window_samples=10, window_speed_limit=0.0)
        self.assertEqual(window(seen, bend()).speed_limit.tolist(), [0.0] * 10)

    def test_of_version_2_the_samples_that_came_count(self):
        seen = messages.Observation(window_first_sample=400)
        seen.window.CopyFrom(message_scene(samples=30).reference_line)
        part = window(seen, bend())
        self.assertEqual((len(part), part.first_sample, part.x[29]), (30, 400, 0.1 * 29))

    def test_one_beyond_the_line_is_refused(self):
        with self.assertRaisesRegex(reloop.ReadError, "ends at sample 301 of a line that has 300"):
            window(messages.Observation(window_first_sample=1, window_samples=300), bend())


class WayTest(unittest.TestCase):
    def test_it_is_told_once_and_remembered(self):
        ways = KnownWays()
        (first,), (second,) = (ways.taken(message_taken(step)) for step in (0, 1))
        self.assertIs(first.way, second.way)
        self.assertEqual((second.track, second.kind, second.since_step), (5, reloop.AgentKind.VEHICLE, 0))
        self.assertEqual((second.state.x, second.state.speed), (60.5, 5.0))
        with self.assertRaisesRegex(reloop.ReadError, r"agents\[0\].way is missing: none was told of track 5"):
            KnownWays().taken(message_taken(1))

    def test_a_way_that_is_none_is_refused(self):
        for change, said in (
            (lambda way: way.samples.z.append(0.0), r"way.samples is no line: its columns have \[100, 101\] numbers"),
            (lambda way: way.ClearField("samples"), r"its columns have \[0\] numbers"),
            (lambda way: way.samples.x.__setitem__(3, np.nan), "way.samples is not finite"),
        ):
            message = message_taken(0)
            change(message.agents[0].way)
            with self.assertRaisesRegex(reloop.ReadError, said):
                KnownWays().taken(message)

    def test_a_point_lies_at_a_station_and_to_a_side_and_lanes_lie_under_it(self):
        (agent,) = KnownWays().taken(message_taken(0))
        way = agent.way
        station, left = way.project([50.3, 40.0, 60.0], [1.0, 0.0, -2.0])
        np.testing.assert_allclose(station, [0.3, 0.0, 10.0], atol=1e-9)
        np.testing.assert_allclose(left, [1.0, 0.0, -2.0], atol=1e-9)
        self.assertEqual((way.length, float(way.height(0.75))), (49.5, 0.015))
        self.assertEqual([way.lane_at(station) for station in (0.0, 29.9, 30.0)], [7, 7, None])

    def test_poses_follow_a_bend(self):
        angle = 0.5 * np.arange(60) / 20.0
        way = Way(np.column_stack([20 * np.sin(angle), 20 * (1 - np.cos(angle)), 0 * angle]), ())
        x, _, heading = way.pose(10.03)
        self.assertAlmostEqual(float(x), 20 * np.sin(10.03 / 20), delta=0.01)
        self.assertAlmostEqual(float(heading), 10.03 / 20, delta=0.01)
        np.testing.assert_array_equal(way.pose(99.0)[:2], way.points[-1, :2])


class LineTest(unittest.TestCase):
    def test_a_point_lies_at_a_station_and_to_a_side(self):
        station, left = bend().project([1.0, 1.0, -3.0], [2.0, -2.0, 0.0])
        self.assertAlmostEqual(station[0], 1.1, delta=0.06)  # inside of the bend
        self.assertAlmostEqual(left[0], 20 - np.hypot(1, 18), delta=0.01)
        self.assertAlmostEqual(left[1], 20 - np.hypot(1, 22), delta=0.01)
        self.assertEqual((station[2], abs(left[2])), (0.0, 3.0))  # before its begin

    def test_poses_are_between_samples_and_end_with_the_line(self):
        curve = bend()
        x, y, heading = curve.pose(10.03)
        angle = 10.03 / 20
        self.assertAlmostEqual(float(x), 20 * np.sin(angle), delta=1e-3)
        self.assertAlmostEqual(float(y), 20 * (1 - np.cos(angle)), delta=1e-3)
        self.assertAlmostEqual(float(heading), angle, delta=1e-3)
        np.testing.assert_array_equal(curve.pose(99.0)[:2], [curve.x[-1], curve.y[-1]])
        self.assertEqual(curve.pose(np.zeros((2, 5))).shape, (2, 5, 3))

    def test_headings_do_not_jump_where_they_pass_a_half_turn(self):
        around = bend(radius=4.0)  # more than a full turn
        headings = around.pose(np.arange(0.0, 29.0, 0.05))[:, 2]
        self.assertLess(np.abs(np.diff(headings)).max(), 0.05)

    def test_a_bend_is_driven_slower_than_a_straight_road(self):
        self.assertAlmostEqual(float(bend(radius=20.0).cruise(15.0)), np.sqrt(2.0 * 20.0), delta=0.05)
        straight = line(message_scene().reference_line)
        self.assertEqual(float(straight.cruise(15.0)), 10.0)
        self.assertEqual(float(bend(radius=1e4).cruise(15.0)), 11.176)  # no limit is known


class StepTest(unittest.TestCase):
    def setUp(self):
        message = message_scene()
        self.scene, self.before = Scene(message), History.before(message)

    def step(self, number, change=lambda observation: None):
        observation = message_observation(number)
        change(observation)
        return step(observation, self.scene, self.before)

    def test_agents_are_columns(self):
        agents = self.step(0).agents
        self.assertEqual((agents.track.tolist(), agents.x.tolist(), agents.speed.tolist()), ([5], [60.0], [5.0]))
        self.assertEqual(agents.kind[0], reloop.AgentKind.VEHICLE)
        self.assertEqual(len(agents[agents.kind == reloop.AgentKind.PEDESTRIAN]), 0)
        self.assertEqual(agents.position.shape, (1, 2))
        with self.assertRaises(ValueError):
            agents.x[0] = 1.0

    def test_nobody_is_columns_too(self):
        alone = self.step(0, lambda seen: seen.ClearField("agents"))
        self.assertEqual((len(alone.agents), alone.agents.position.shape, len(alone.ahead())), (0, (0, 2), 0))

    def test_the_history_keeps_as_many_steps_as_the_scene_told_and_one_more(self):
        for number in range(4):
            self.before = self.step(number).history
        self.assertEqual(self.before.log_index.tolist(), [3, 4, 5])
        np.testing.assert_array_equal(self.before.of([5, 99])[0, :, 0], [60.5, 61.0, 61.5])
        self.assertTrue(np.isnan(self.before.of([5, 99])[1]).all())
        self.assertEqual(self.before.av.shape, (3, 7))

    def test_a_step_that_the_history_has_already_is_replaced(self):
        self.assertEqual(self.step(0).history.log_index.tolist(), [0, 1, 2])
        again = self.step(0, lambda seen: setattr(seen, "log_index", 1))
        self.assertEqual(again.history.log_index.tolist(), [0, 1])

    def test_ahead_are_agents_in_the_way_red_lights_and_the_end_of_the_line(self):
        def change(seen):
            seen.red_stops.append(450)
            for track, x, y in ((6, 40.0, 2.5), (7, 40.0, 1.5), (8, 10.0, 0.0)):  # beside, in the way, behind
                seen.agents.add(track=track, kind=1)
                state = seen.agents[-1].state
                state.x, state.y, state.length, state.width = x, y, 4.0, 1.8

        ahead = self.step(0, change).ahead()
        self.assertEqual(ahead.track.tolist(), [7, -1, 5])
        np.testing.assert_allclose(ahead.station, [38.0, 45.0, 58.0])
        self.assertEqual(ahead.speed.tolist(), [0.0, 0.0, 5.0])
        end = self.step(0, lambda seen: setattr(seen, "window_samples", 2000)).ahead()
        self.assertEqual((end.track.tolist(), round(end.station[1], 6)), ([5, -1], 199.9))

    def test_the_map_is_by_id(self):
        lane = self.scene.map.lanes[7]
        self.assertAlmostEqual(lane.speed_limit, 11.176)
        np.testing.assert_array_equal(lane.centerline, [[0, 0, 0], [0.5, 0, 0]])
        self.assertEqual((lane.exits, self.scene.map.crosswalks), ((8,), {}))


if __name__ == "__main__":
    unittest.main()
